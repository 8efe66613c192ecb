"""Pools of new arrays for the results of calls, allocated for many calls together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from marl_airhockey.types import Array

ROWS = 64
"""Number of rows that are allocated together. NumPy indexes an array faster than it
allocates a new one."""


class BufferPool:
    """Pool of freshly allocated, uninitialised arrays.

    Args:
        kinds: Shape and dtype of a row of each array.
    """

    def __init__(self, kinds: Sequence[tuple[tuple[int, ...], Any]]) -> None:
        self._kinds = list(kinds)
        self._waiting: dict[int, list[tuple[Array, ...]]] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_waiting": {}}

    def take(self, rows: int) -> tuple[Array, ...]:
        """Return one array of each kind with this number of rows."""
        waiting = self._waiting.get(rows)
        if waiting:
            return waiting.pop()
        if rows >= ROWS or not self._kinds:
            return tuple(np.empty((rows, *shape), kind) for shape, kind in self._kinds)
        calls = ROWS // max(rows, 1)
        blocks = [np.empty((calls, rows, *s), kind) for s, kind in self._kinds]
        self._waiting[rows] = waiting = list(zip(*blocks, strict=True))
        return waiting.pop()
