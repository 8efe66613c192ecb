"""Where the table and the arms' bases stand in the world of the 3D simulator.

The world's z is up. The table frame is that of `table.Table`, its plane raised toward
the far end by the tilt, its z the surface's normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.core.scene import Scene
from marl_airhockey.types import Array

HEIGHT = 0.8
"""m above the floor, of the table's centre."""
BEHIND = 0.22
"""m from the edge of a seat's side to its arm's base. With it a UR5e holds the robot
seat at 0.7 m/s in every direction with joints under 0.9 pi rad/s, on a flat table and
on one of 5.5 degrees, at both ends; with 0.20 and 0.25 it does not."""
BELOW = 0.02
"""m by which a base stands lower than the edge in front of it."""


@dataclass(frozen=True)
class TableFrame:
    """A table that is tilted by some degrees."""

    tilt: float = 0.0
    """deg"""

    @cached_property
    def rotation(self) -> Array:
        """(3, 3) from the table frame to the world's."""
        c, s = np.cos(np.radians(self.tilt)), np.sin(np.radians(self.tilt))
        return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])

    @cached_property
    def origin(self) -> Array:
        """(3,) m, the table's centre."""
        return np.array([0.0, 0.0, HEIGHT])

    @cached_property
    def quaternion(self) -> Array:
        """(4,) of `rotation`, w first."""
        half = -np.radians(self.tilt) / 2
        return np.array([np.cos(half), 0.0, np.sin(half), 0.0])

    def to_world(self, x: float, y: float, z: float = 0.0) -> Array:
        """(3,) m, of a point in the table frame."""
        return np.asarray(self.origin + self.rotation @ (x, y, z))

    def gravity(self, tilt: float, strength: float) -> Array:
        """(3,) m/s2 that pulls as on a table of another tilt, which stays as it is."""
        more = np.radians(tilt - self.tilt)
        return -strength * np.array([np.sin(more), 0.0, np.cos(more)])

    def base(self, scene: Scene, seat: int) -> tuple[Array, float]:
        """Position (3,) and heading about z, rad, of the base of a seat's arm."""
        table, side = scene.table, scene.seats[seat].side
        normal, away = table.normals[side], table.offsets[side] + BEHIND
        x, y = -normal * away
        edge = -normal * table.offsets[side]
        z = self.to_world(float(edge[0]), float(edge[1]))[2] - BELOW
        return np.array([x, y, z]), float(np.arctan2(normal[1], normal[0]))

    def grip(self, scene: Scene, seat: int) -> Array:
        """(3, 3) orientation of a paddle in the world: its z into the table.

        Its x points from the base over the table.
        """
        normal = scene.table.normals[scene.seats[seat].side]
        x = self.rotation @ (normal[0], normal[1], 0.0)
        z = -self.rotation[:, 2]
        return np.stack([x, np.cross(z, x), z], 1)
