"""Block: numbers that one process writes and others read, without a lock.

A counter is odd while a block is written, so that a reader never takes half of an old
one; a process that is killed while it writes leaves nothing held.
"""

from __future__ import annotations

import time

from marl_airhockey.types import Array

PATIENCE = 0.05
"""Time after which a block that is being written has been left so, s"""


class Block:
    """Numbers in shared memory, the first of which counts writes."""

    def __init__(self, numbers: Array) -> None:
        self._counter, self._numbers = numbers[:1], numbers[1:]

    def write(self, values: tuple[float, ...] | Array) -> None:
        """Write all numbers."""
        # Odd whatever a writer that was killed has left.
        self._counter[0] += 1 + self._counter[0] % 2
        self._numbers[:] = values
        self._counter[0] += 1

    def read(self) -> Array:
        """Return all numbers as they were written together; a copy."""
        until = time.monotonic() + PATIENCE
        while True:
            before = self._counter[0]
            numbers = self._numbers.copy()
            whole = before % 2 == 0 and self._counter[0] == before
            if whole or time.monotonic() > until:
                return numbers
