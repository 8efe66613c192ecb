"""Frames of the table and of the arm bases in the world frame of MuJoCo.

The z axis of the world frame points up. The table frame is the frame of `table.Table`.
The tilt raises its plane toward the far end. Its z axis is the normal of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

HEIGHT = 0.8
"""Height of the table's centre above the ground, m."""
BEHIND = 0.22
"""Distance of an arm's base from the edge of its side, m. With 0.22 m a UR5e can move
at 0.7 m/s in every direction in the whole workspace of the robot seat, with joint
speeds below 0.9 pi rad/s. This holds at both ends, on a level table and at 5.5 degrees.
It does not hold for 0.20 and 0.25 m."""
BELOW = 0.02
"""Height above a base of the table's edge in front of it, m."""


@dataclass(frozen=True)
class TableFrame:
    """Frame of a tilted table."""

    tilt: float = 0.0
    """Tilt of the table, degrees."""

    @cached_property
    def rotation(self) -> Array:
        """Rotation from the table frame to the world frame (3, 3)."""
        c, s = np.cos(np.radians(self.tilt)), np.sin(np.radians(self.tilt))
        return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])

    @cached_property
    def origin(self) -> Array:
        """Centre of the table (3,), world frame, m."""
        return np.array([0.0, 0.0, HEIGHT])

    @cached_property
    def quaternion(self) -> Array:
        """Quaternion of `rotation` (4,), w first."""
        half = -np.radians(self.tilt) / 2
        return np.array([np.cos(half), 0.0, np.sin(half), 0.0])

    def to_world(self, x: float, y: float, z: float = 0.0) -> Array:
        """Transform a point from the table frame to the world frame (3,), m."""
        return np.asarray(self.origin + self.rotation @ (x, y, z))

    def gravity(self, tilt: float, cross_tilt: float, strength: float) -> Array:
        """Return the gravity (3,), m/s2, that emulates other tilts (degrees)."""
        more, aside = np.radians(tilt - self.tilt), np.radians(cross_tilt)
        return -strength * np.array([np.sin(more), np.sin(aside), np.cos(more)])

    def base(self, scene: Scene, seat: int) -> tuple[Array, float]:
        """Return position (3,), m, and heading, rad, of an arm's base, world frame."""
        table, side = scene.table, scene.seats[seat].side
        normal, distance = table.normals[side], table.offsets[side] + BEHIND
        x, y = -normal * distance
        edge = -normal * table.offsets[side]
        z = self.to_world(float(edge[0]), float(edge[1]))[2] - BELOW
        return np.array([x, y, z]), float(np.arctan2(normal[1], normal[0]))

    def foot_rotation(self, scene: Scene, seat: int) -> Array:
        """Return the target rotation from a paddle's foot to the world frame (3, 3).

        The z axis of the foot points into the table, the x axis from the base over it.
        """
        normal = scene.table.normals[scene.seats[seat].side]
        x = self.rotation @ (normal[0], normal[1], 0.0)
        z = -self.rotation[:, 2]
        return np.stack([x, np.cross(z, x), z], 1)
