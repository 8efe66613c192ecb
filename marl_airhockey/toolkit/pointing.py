"""Pointing: a velocity by which a paddle comes to rest where somebody points."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.driver import View
from marl_airhockey.sim.core.geometry import length
from marl_airhockey.types import Array

GAIN = 25.0
"""Commanded speed per distance near the target, 1/s"""
STEADY = 0.6
"""Largest product of that and of a lag: beyond, the paddle swings about the target"""
BRAKE = 0.6
"""Share of the seat's acceleration that is assumed for stopping in time"""
ARM_LAG = 0.08
"""Time by which an arm answers late as a rule, s: a servo's lag, its dead time and half
of a control step; `calibrate delay` measures the first two"""


def point_to(
    view: View, target: Array, moving: Array | None = None, lag: float = 0.0
) -> Array:
    """Return the actions (B, 2) that bring paddles to targets.

    They are bounded by the seat's top speed and by a speed from which the paddle can
    still stop in time; `limits` bounds them further, as for every driver.

    Args:
        view: of the seat.
        target: (2,) or (B, 2), ego frame, m.
        moving: velocity of the targets (2,) or (B, 2), m/s; None at rest.
        lag: time by which the paddle answers late, s. It would go on by so much if it
            were stopped now, and swings about the target if nobody compensates for it.
    """
    gain = min(GAIN, STEADY / lag) if lag else GAIN
    way = target - view.state.paddle[:, view.seat]
    way = way - lag * view.state.paddle_velocity[:, view.seat]
    if moving is not None:
        # With so much to go it is as fast as the target when it is there.
        way = way + (lag + 1.0 / gain) * moving
    far = np.maximum(length(way), 1e-9)
    brake = BRAKE * view.scene.seats[view.seat].acceleration
    speed = np.minimum(gain * far, np.sqrt(2.0 * brake * far))
    speed = np.minimum(speed, view.top_speed)
    return np.asarray(way * (speed / far / view.top_speed)[:, None])
