"""Rows of worlds on several threads, for loops that let go of Python's lock.

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
"""Rows that a thread is worth."""


@cache
def threads() -> int:
    """How many threads there may be.

    Raises:
        ValueError: MARL_AIRHOCKEY_THREADS is no whole number above 0.
    """
    given = os.environ.get("MARL_AIRHOCKEY_THREADS", "1")
    if not given.isdigit() or int(given) < 1:
        raise ValueError(
            f"MARL_AIRHOCKEY_THREADS: {given!r} must be a whole number above 0"
        )
    return int(given)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads(), "marl_airhockey")


def over_rows(work: Callable[[slice], None], rows: int) -> None:
    """Call ``work`` on slices of rows 0 .. ``rows``, side by side."""
    parts = min(threads(), rows // LEAST)
    if parts < 2:
        work(slice(None))
        return
    edges = [rows * k // parts for k in range(parts + 1)]
    slices = [slice(a, b) for a, b in pairwise(edges)]
    for done in [_pool().submit(work, part) for part in slices]:
        done.result()


def spreads(rows: int) -> bool:
    """Whether so many rows go to more than one thread."""
    return threads() > 1 and rows >= 2 * LEAST
