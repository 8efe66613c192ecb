"""Delay: values as they were some time ago."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array

Rows = Array | slice
"""Some of the worlds: indices (W,), or all of them."""
ALL = slice(None)


class Delay:
    """Delay line of values of B worlds, interpolated between control steps.

    Args:
        longest: the largest delay, s.
        control_dt: s between two values.
        shape: (B, ...) of a value.
    """

    def __init__(
        self, longest: float, control_dt: float, shape: tuple[int, ...]
    ) -> None:
        self.control_dt = control_dt
        self.depth = int(np.ceil(longest / control_dt - 1e-9)) + 1
        self._past = np.zeros((shape[0], self.depth, *shape[1:]))

    @property
    def newest(self) -> Array:
        """Values (B, ...) that were pushed last, not to be changed."""
        return self._past[:, -1]

    def fill(self, rows: Rows, past: Array | float) -> None:
        """Begin anew in some worlds with the past (W, depth, ...)."""
        self._past[rows] = past

    def push(self, value: Array, delay: Array, rows: Rows = ALL) -> Array:
        """Take the newest value (W, ...) and return that of ``delay`` (W,) s ago."""
        past = np.concatenate([self._past[rows][:, 1:], value[:, None]], axis=1)
        self._past[rows] = past
        back = delay / self.control_dt
        whole = np.floor(back).astype(np.int64)
        share = (back - whole).reshape(-1, *(1,) * (value.ndim - 1))
        worlds, last = np.arange(len(value)), self.depth - 1
        newer = past[worlds, np.maximum(last - whole, 0)]
        older = past[worlds, np.maximum(last - whole - 1, 0)]
        return np.asarray((1 - share) * newer + share * older)
