"""Plant: model of the objects that the tool of an emulated arm touches.

The controller calls its plant once in every period, after the joints have moved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from marl_airhockey.types import Array

STIFFNESS = 2e4
"""Stiffness of a table under a paddle that is pressed on it, N/m."""


class PlantReading(NamedTuple):
    """Response of a plant to a pose of the tool."""

    pose: Array
    """Measured pose (6,) of the tool's centre, base frame: position, m, and rotation
    vector, rad."""
    force: Array
    """Contact force and torque (6,) on the tool, base frame, N and Nm."""


Plant = Callable[[Array, Array], PlantReading]
"""Function from the pose (6,) and velocity (6,) of the tool's centre, base frame, to
the measurements there."""


@dataclass
class EmptyTable:
    """Plant of an arm over an empty table: a stiff plane."""

    origin: Array
    """Point (3,) of the plane, base frame, m."""
    normal: Array
    """Upward unit vector (3,), base frame."""
    raised: float = 0.0
    """Height of an object under the paddle, m."""

    def __call__(self, pose: Array, velocity: Array) -> PlantReading:
        depth = self.raised - (pose[:3] - self.origin) @ self.normal
        force = np.zeros(6)
        if depth > 0.0:
            force[:3] = STIFFNESS * depth * self.normal
        return PlantReading(pose, force)
