"""Table: a convex polygon, its sides and their ego frames.

The origin of the table frame is the centroid. On a rectangle, x points along the length
from the home end (side 0) to the far end, and y points to the left. The ego frame of a
side is the table frame, rotated so that the side's inward normal is +x.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from marl_airhockey.sim.core.geometry import _cross, interpolate, length
from marl_airhockey.sim.core.parameters import PRESETS
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.types import Array

GRAVITY = 9.81
"""Standard gravity (m/s2)."""


BOX = (
    *((0.0782, 0.25), (0.0782, -0.25), (0.4182, -0.25)),
    *((0.4982, -0.15), (0.4982, 0.15), (0.4182, 0.25)),
)
"""Workspace of an arm on the standard table: a box whose far corners are cut at a slope
of 0.8, as by the paper's authors."""
WIDE = (
    *((0.0782, 0.36), (0.0782, -0.36), (0.42, -0.36), (0.47, -0.25), (0.51, -0.08)),
    *((0.51, 0.08), (0.47, 0.25), (0.42, 0.36)),
)
"""Whole workspace of a UR5e with its base 0.22 m behind the side. By inverse
kinematics, no joint is faster than 0.9 pi rad/s at 0.7 m/s in any direction, flat or
tilted."""


@dataclass(frozen=True)
class Obstacle:
    """Static disc, or a rounded segment if ``end`` is given, table frame, m."""

    start: tuple[float, float]
    radius: float
    end: tuple[float, float] | None = None


@dataclass(frozen=True)
class Table:
    """Convex playing surface. `TABLES` holds presets.

    Raises:
        ValueError: The polygon is not convex and counter-clockwise around the origin,
            or a disc does not fit on it.
    """

    vertices: tuple[tuple[float, float], ...]
    """Corners (m), counter-clockwise; side k runs from corner k to k + 1."""
    paddle_radius: float = 0.047625
    """Radius of a paddle (m). The diameter is 3.75 inches."""
    puck_radius: float = 0.03175
    """Radius of a puck (m). The diameter is 2.5 inches."""
    robot_reach: tuple[tuple[float, float], ...] = BOX
    """Workspace of a UR5e at a side: a convex polygon of x, measured from the side, and
    y, m."""
    obstacles: tuple[Obstacle, ...] = ()
    physics: dict[str, float] = field(default_factory=dict, hash=False)
    """Physical parameters that this table sets, by name."""

    def __post_init__(self) -> None:
        corners = np.asarray(self.vertices, dtype=float)
        if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2:
            raise ValueError("table.vertices: at least three (x, y) corners are needed")
        ahead = np.roll(corners, -1, axis=0) - corners
        bend = _cross(ahead, np.roll(ahead, -1, axis=0))
        if (bend <= 0).any():
            raise ValueError("table.vertices: must be convex and counter-clockwise")
        if (self.offsets <= 0).any():
            raise ValueError("table.vertices: the origin must lie inside the table")
        for name in ("paddle_radius", "puck_radius"):
            radius = getattr(self, name)
            if not 0 < radius < self.offsets.min():
                raise ValueError(
                    f"table.{name}: {radius} m does not fit on this table; it must be "
                    f"above 0 and below {self.offsets.min():.3f} m"
                )

    @staticmethod
    def rectangle(length: float, width: float, **physics: float) -> Table:
        """Return a table of ``length`` x ``width`` m; side 0 is home, 2 the far end."""
        x, y = length / 2, width / 2
        return Table(((-x, y), (-x, -y), (x, -y), (x, y)), physics=physics)

    @staticmethod
    def regular(sides: int, inradius: float) -> Table:
        """Return a regular polygon with sides ``inradius`` m from the centre."""
        radius = inradius / cos(np.pi / sides)
        angles = np.pi - np.pi / sides + 2 * np.pi * np.arange(sides) / sides
        # Side 0 faces +x and is at x = -inradius, like home on a rectangle.
        corners = radius * np.stack([cos(angles), sin(angles)], -1)
        return Table(tuple((float(x), float(y)) for x, y in corners))

    @cached_property
    def normals(self) -> Array:
        """Inward unit normals (sides, 2)."""
        corners = np.asarray(self.vertices, dtype=float)
        ahead = np.roll(corners, -1, axis=0) - corners
        ahead /= length(ahead)[:, None]
        return np.stack([-ahead[:, 1], ahead[:, 0]], -1)

    @cached_property
    def offsets(self) -> Array:
        """Distances of the sides from the origin (sides,), m."""
        inward = (self.normals * np.asarray(self.vertices)).sum(-1)
        return np.asarray(-inward)

    @cached_property
    def size(self) -> Array:
        """Extent of the bounding box (2,), m."""
        return np.asarray(np.ptp(np.asarray(self.vertices), axis=0))

    def from_standard(self, points: Array) -> Array:
        """Map points (..., 2) of the standard table to this table, m.

        The workspace of a UR5e is mapped to its workspace here. x is piecewise linear
        between the home side, the near and the far edge of `robot_reach`, and the far
        end. y is proportional to the width of `robot_reach`. On the standard table
        points do not change.
        """
        (x, width), (new_x, new_width) = _knots(TABLES["standard"]), _knots(self)
        if x == new_x and width == new_width:
            return points
        along = interpolate(points[..., 0], x, new_x)
        return np.stack([along, points[..., 1] * (new_width / width)], -1)

    def ends(self, side: int) -> tuple[Array, Array]:
        """Return the two corners of a side, (2,) each, m."""
        corners = np.asarray(self.vertices, dtype=float)
        return corners[side], corners[(side + 1) % len(corners)]

    def rotation(self, side: int) -> Array:
        """Return the rotation (2, 2) from the table frame to the side's ego frame."""
        c, s = self.normals[side]
        return np.array([[c, s], [-s, c]])


def _knots(table: Table) -> tuple[tuple[float, ...], float]:
    """Return x of home, both edges of the workspace and the far end; its width, m."""
    home = -float(table.offsets[0])
    along, across = zip(*table.robot_reach, strict=True)
    far = home + float(table.size[0])
    return (home, home + min(along), home + max(along), far), max(across) - min(across)


TABLES: dict[str, Table] = {
    "standard": Table.rectangle(1.6764, 0.6096),
    "full_size": replace(Table.rectangle(1.9304, 0.8636), robot_reach=WIDE),
    "ubc_pro": replace(
        Table.rectangle(2.362, 1.144),
        puck_radius=0.0413,
        paddle_radius=0.0505,
        robot_reach=WIDE,
    ),
    "ubc_wood": replace(
        Table.rectangle(1.9885, 0.9905, **PRESETS["wooden"]),
        puck_radius=0.03145,
        paddle_radius=0.0501,
        robot_reach=WIDE,
    ),
}
"""Table presets. ``standard`` and ``full_size`` are the workspace of 66 x 24 in and the
table of 76 x 34 in of the paper. ``ubc_pro`` and ``ubc_wood`` are the professional and
the home-made wooden table that were measured in play. ``ubc_wood`` includes its
physics."""
