"""Threads over rows of worlds, for loops that release the GIL.

MARL_AIRHOCKEY_THREADS is the largest number of threads (default 1). Idle threads sleep,
so they take no CPU time from other processes.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

LEAST = 2048
"""Smallest number of rows of cheap worlds that is worth a thread."""


@cache
def threads() -> int:
    """Return the largest number of threads.

    Raises:
        ValueError: MARL_AIRHOCKEY_THREADS is not a whole number above 0.
    """
    given = os.environ.get("MARL_AIRHOCKEY_THREADS", "1")
    if not given.isdigit() or int(given) < 1:
        raise ValueError(
            f"MARL_AIRHOCKEY_THREADS: {given!r} must be a whole number above 0"
        )
    return int(given)


def use_threads(number: int | None) -> int | None:
    """Set the number of threads in this process and its future child processes.

    Raises:
        ValueError: The number is below 1.
    """
    if number is not None:
        os.environ["MARL_AIRHOCKEY_THREADS"] = str(number)
        threads.cache_clear()
        _pool.cache_clear()
        threads()
    return number


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads(), "marl_airhockey")


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def over_rows(work: Callable[[slice], None], rows: int, least: int = LEAST) -> None:
    """Call ``work`` on slices of rows 0 .. ``rows`` in parallel.

    Args:
        work: Function of a slice.
        rows: Number of rows.
        least: Smallest number of rows that is worth a thread.
    """
    parts = min(threads(), rows // least)
    if parts < 2:
        work(slice(None))
        return
    edges = [rows * k // parts for k in range(parts + 1)]
    slices = [slice(a, b) for a, b in pairwise(edges)]
    for done in [_pool().submit(work, part) for part in slices]:
        done.result()


def spreads(rows: int) -> bool:
    """Return True if several threads share this number of rows."""
    return threads() > 1 and rows >= 2 * LEAST
