"""Lock-free block of numbers that one process writes and others read.

A counter is odd while a block is written, so that a reader does not mix old and new
numbers. A process that is killed while it writes leaves no lock behind.
"""

from __future__ import annotations

import time

from marl_airhockey.types import Array

PATIENCE = 0.05
"""Time after which a reader no longer waits for an unfinished write, s."""


class Block:
    """Numbers in shared memory; the first one counts writes.

    Args:
        numbers: Counter and n values (1 + n,).
    """

    def __init__(self, numbers: Array) -> None:
        self._counter, self._numbers = numbers[:1], numbers[1:]

    def write(self, values: tuple[float, ...] | Array) -> None:
        """Write all numbers."""
        # Odd, even if the last writer was killed.
        self._counter[0] += 1 + self._counter[0] % 2
        self._numbers[:] = values
        self._counter[0] += 1

    def read(self) -> Array:
        """Return a copy of all numbers of one write."""
        until = time.monotonic() + PATIENCE
        while True:
            before = self._counter[0]
            numbers = self._numbers.copy()
            whole = before % 2 == 0 and self._counter[0] == before
            if whole or time.monotonic() > until:
                return numbers
