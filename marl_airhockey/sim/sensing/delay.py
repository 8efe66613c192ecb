"""Delay lines: past values of B worlds."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array, Rows


def depth(longest: float, control_dt: float) -> int:
    """Return the number of samples, one per step, for delays up to ``longest``, s."""
    return int(np.ceil(longest / control_dt - 1e-9)) + 1


class Delay:
    """Delay line of values of B worlds, interpolated between control steps.

    Args:
        longest: Largest delay, s.
        control_dt: Time between two values, s.
        shape: Shape (B, ...) of a value.
    """

    def __init__(
        self, longest: float, control_dt: float, shape: tuple[int, ...]
    ) -> None:
        self.control_dt = control_dt
        self._past = np.zeros((shape[0], depth(longest, control_dt), *shape[1:]))

    def fill(self, rows: Rows, past: Array | float) -> None:
        """Replace the past (W, depth, ...) of some worlds."""
        self._past[rows] = past

    def push(self, value: Array, delay: Array) -> Array:
        """Append the newest value (B, ...); return the value ``delay`` (B,) s ago."""
        past, out = self._past, np.empty(value.shape)
        flat = past.reshape(*past.shape[:2], -1), value.reshape(len(value), -1)
        _push(*flat, delay, self.control_dt, out.reshape(len(value), -1))
        return out


@compiled(nogil=True, error_model="numpy")
def _push(past: Array, value: Array, delay: Array, dt: float, out: Array) -> None:
    for w in range(len(past)):
        append(past[w], value[w])
        older, newer, share = around(len(past[w]), delay[w] / dt)
        for k in range(len(value[w])):
            out[w, k] = share * past[w, newer, k] + (1 - share) * past[w, older, k]


@inner(error_model="numpy")
def append(past: Array, newest: Array) -> None:
    """Append a value (n,) to a past (depth, n) and drop the oldest value."""
    for k in range(len(past) - 1):
        past[k] = past[k + 1]
    past[-1] = newest


@compiled(nogil=True, error_model="numpy")
def around(samples: int, back: float) -> tuple[int, int, float]:
    """Return the samples around a time ``back`` steps before the last of them.

    Returns:
        The indices before and after that time, and the share of the step between them
        that precedes it.
    """
    whole = int(np.floor(back))
    newer = samples - 1 - whole
    return max(newer - 1, 0), max(newer, 0), 1.0 - (back - whole)


@inner(error_model="numpy")
def position_before(past: Array, delay: float, dt: float) -> tuple[float, float]:
    """Return the position of a body ``delay`` s before its last sample, m.

    The trajectory is straight except for one kink within a step, as at a wall bounce or
    a hit. The kink is where the straight lines before and after the step meet. If they
    are parallel, it is in the middle of the step. The error is then 0.3 mm for an
    acceleration of 0.94 m/s2 over 50 ms.

    Args:
        past: Samples (depth, 4), a step apart: x and y, m; vx and vy, m/s.
        delay: Time before the last sample, s.
        dt: Length of a step, s.
    """
    before, after, share = around(len(past), delay / dt)
    older, newer = past[before], past[after]
    change_x, change_y = older[2] - newer[2], older[3] - newer[3]
    gap_x = newer[0] - older[0] - newer[2] * dt
    gap_y = newer[1] - older[1] - newer[3] * dt
    square = change_x * change_x + change_y * change_y
    kink = (gap_x * change_x + gap_y * change_y) / max(square, 1e-12)
    since = share * dt
    if since < kink:
        return older[0] + older[2] * since, older[1] + older[3] * since
    rest = dt - since
    return newer[0] - newer[2] * rest, newer[1] - newer[3] * rest
