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
        older, newer, share = self._pushed(value, delay, rows)
        return np.asarray(share * newer + (1 - share) * older)

    def _pushed(
        self, value: Array, delay: Array, rows: Rows
    ) -> tuple[Array, Array, Array]:
        """Take the newest value; return those before and after a moment of the past.

        Returns:
            Two values (W, ...), and which part of the step between them lies before the
            moment, (W, 1, ...).
        """
        past = np.concatenate([self._past[rows][:, 1:], value[:, None]], axis=1)
        self._past[rows] = past
        back = delay / self.control_dt
        whole = np.floor(back).astype(np.int64)
        share = 1.0 - (back - whole).reshape(-1, *(1,) * (value.ndim - 1))
        worlds, last = np.arange(len(value)), self.depth - 1
        newer = past[worlds, np.maximum(last - whole, 0)]
        older = past[worlds, np.maximum(last - whole - 1, 0)]
        return older, newer, share


class WayDelay(Delay):
    """Delay line of the ways of bodies: straight, with one kink within a step.

    The kink is where the way before a step and that after it meet, as at a bank or a
    hit; without one it is in the middle, 0.3 mm off the way that a slope of 0.94 m/s2
    makes in 50 ms.

    Args:
        longest: the largest delay, s.
        control_dt: s between two motions.
        shape: (B, bodies) of them.
    """

    def __init__(
        self, longest: float, control_dt: float, shape: tuple[int, ...]
    ) -> None:
        super().__init__(longest, control_dt, (*shape, 4))

    def place(self, motion: Array, delay: Array, rows: Rows = ALL) -> Array:
        """Take motions (W, bodies, 4) x, y, vx, vy; return places ``delay`` s ago."""
        older, newer, share = self._pushed(motion, delay, rows)
        dt, before, after = self.control_dt, older[..., 2:], newer[..., 2:]
        change = before - after
        gap = newer[..., :2] - older[..., :2] - after * dt
        square = (change * change).sum(-1, keepdims=True)
        kink = (gap * change).sum(-1, keepdims=True) / np.maximum(square, 1e-12)
        since = share * dt
        along = older[..., :2] + before * since
        back = newer[..., :2] - after * (dt - since)
        return np.where(since < kink, along, back)
