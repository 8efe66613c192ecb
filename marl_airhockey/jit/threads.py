"""Threads for rows of worlds, used by loops that release Python's lock.

MARL_AIRHOCKEY_THREADS says how many threads there may be (1). They sleep while there is
nothing to do, so that they take nothing from others.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

LEAST = 2048
"""Rows of cheap worlds that pay for a thread."""


@cache
def threads() -> int:
    """Return the largest number of threads.

    Raises:
        ValueError: MARL_AIRHOCKEY_THREADS is no whole number above 0.
    """
    given = os.environ.get("MARL_AIRHOCKEY_THREADS", "1")
    if not given.isdigit() or int(given) < 1:
        raise ValueError(
            f"MARL_AIRHOCKEY_THREADS: {given!r} must be a whole number above 0"
        )
    return int(given)


def use_threads(number: int | None) -> int | None:
    """Set the number of threads, here and in processes that begin here.

    Raises:
        ValueError: fewer than one.
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


# A child of a process has none of its threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def over_rows(work: Callable[[slice], None], rows: int, least: int = LEAST) -> None:
    """Call ``work`` on slices of rows 0 .. ``rows``, side by side.

    Args:
        work: done for a slice.
        rows: how many there are.
        least: rows that pay for a thread.
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
    """Tell whether so many rows go to more than one thread."""
    return threads() > 1 and rows >= 2 * LEAST
