"""Pointing: control of a paddle by target positions."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.driver import View
from marl_airhockey.sim.core.geometry import length
from marl_airhockey.types import Array

GAIN = 25.0
"""Commanded speed per distance near the target, 1/s."""
STEADY = 0.6
"""Largest product of gain and lag. Above it, the paddle oscillates."""
BRAKE = 0.6
"""Share of the seat's largest acceleration that is used for braking."""
ARM_LAG = 0.08
"""Typical lag of an arm, s: servo lag, dead time and half of a control step. `airhockey
calibrate delay` measures the first two."""


def point_to(
    view: View, target: Array, moving: Array | None = None, lag: float = 0.0
) -> Array:
    """Return the actions (B, 2) that move paddles to targets.

    The speed is at most the top speed of the seat, and at most the speed from which the
    paddle can still brake in time. `limits` limits it further, as for every driver.

    Args:
        view: View of the seat.
        target: Target positions (2,) or (B, 2), ego frame, m.
        moving: Velocities of the targets (2,) or (B, 2), ego frame, m/s; None at rest.
        lag: Lag of the paddle, s. A stopped paddle continues to move for this time. The
            actions compensate for it; otherwise the paddle would oscillate.
    """
    gain = min(GAIN, STEADY / lag) if lag else GAIN
    way = target - view.state.paddle[:, view.seat]
    way = way - lag * view.state.paddle_velocity[:, view.seat]
    if moving is not None:
        # At the target, the paddle then has the velocity of the target.
        way = way + (lag + 1.0 / gain) * moving
    far = np.maximum(length(way), 1e-9)
    brake = BRAKE * view.scene.seats[view.seat].acceleration
    speed = np.minimum(gain * far, np.sqrt(2.0 * brake * far))
    speed = np.minimum(speed, view.top_speed)
    return np.asarray(way * (speed / far / view.top_speed)[:, None])
