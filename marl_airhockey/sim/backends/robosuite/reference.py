"""Reference motion of a paddle: linear velocity ramps close to the paddle."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array

MAX_LEAD = 0.02
"""Largest distance of the reference from the paddle, m."""


@compiled()
def reference_motion(
    start: Array, old: Array, new: Array, period: float, elapsed: float, out: Array
) -> None:
    """Compute the reference motion in a control step: a linear velocity ramp.

    Args:
        start: Position at the beginning of the step (2,), table frame, m.
        old: Velocity at the beginning of the step (2,), m/s.
        new: Velocity at the end of the step (2,), m/s.
        period: Length of the step, s.
        elapsed: Time since the beginning of the step, s.
        out: Position (m), velocity (m/s) and acceleration (m/s2) (3, 2), filled.
    """
    for i in range(2):
        a = (new[i] - old[i]) / period
        out[0, i] = start[i] + old[i] * elapsed + 0.5 * a * elapsed * elapsed
        out[1, i] = old[i] + a * elapsed
        out[2, i] = a


def limit_lead(wanted: Array, position: Array) -> Array:
    """Limit reference positions (..., 2), m, to `MAX_LEAD` from the paddle."""
    lead = wanted - position
    distance = np.hypot(lead[..., 0], lead[..., 1])[..., None]
    share = np.minimum(1.0, MAX_LEAD / np.maximum(distance, 1e-9))
    return np.asarray(position + lead * share)
