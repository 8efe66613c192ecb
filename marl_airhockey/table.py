"""The table: a convex polygon, its sides, and the seats with their ego frames.

Table frame: origin at the centroid; for a rectangle x runs along the length from the
home end (side 0) to the far end, y to the left. The ego frame of a side is the table
frame rotated so that the side's inward normal is +x.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Literal

import numpy as np

from marl_airhockey.state import Array

GRAVITY = 9.81
"""m/s2"""


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


@dataclass(frozen=True)
class Table:
    """A convex playing surface; defaults are given by `TABLES`.

    Raises:
        ValueError: a polygon that is not convex and counter-clockwise about the
            origin, or a disc that does not fit on it.
    """

    vertices: tuple[tuple[float, float], ...]
    """Corners in metres, counter-clockwise; side k runs from corner k to k + 1."""
    paddle_radius: float = 0.047625
    """m (3.75 in diameter)"""
    puck_radius: float = 0.03175
    """m (2.5 in diameter)"""
    physics: dict[str, float] = field(default_factory=dict, hash=False)
    """Physical parameters that come with this table, by name."""

    def __post_init__(self) -> None:
        corners = np.asarray(self.vertices, dtype=float)
        if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2:
            raise ValueError("table.vertices: at least three (x, y) corners are needed")
        ahead = np.roll(corners, -1, axis=0) - corners
        turn = _cross(ahead, np.roll(ahead, -1, axis=0))
        if (turn <= 0).any():
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
        """A table of ``length`` x ``width`` metres; side 0 is home, 2 the far end."""
        x, y = length / 2, width / 2
        return Table(((-x, y), (-x, -y), (x, -y), (x, y)), physics=physics)

    @staticmethod
    def regular(sides: int, inradius: float) -> Table:
        """A regular polygon whose sides lie ``inradius`` metres from the centre."""
        radius = inradius / np.cos(np.pi / sides)
        angles = np.pi - np.pi / sides + 2 * np.pi * np.arange(sides) / sides
        # Side 0 faces +x: it stands at x = -inradius, as home does on a rectangle.
        corners = radius * np.stack([np.cos(angles), np.sin(angles)], -1)
        return Table(tuple((float(x), float(y)) for x, y in corners))

    @cached_property
    def normals(self) -> Array:
        """(sides, 2) inward unit normals."""
        corners = np.asarray(self.vertices, dtype=float)
        ahead = np.roll(corners, -1, axis=0) - corners
        ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
        return np.stack([-ahead[:, 1], ahead[:, 0]], -1)

    @cached_property
    def offsets(self) -> Array:
        """(sides,) distance of each side from the origin, m."""
        inward = (self.normals * np.asarray(self.vertices)).sum(-1)
        return np.asarray(-inward)

    @cached_property
    def size(self) -> Array:
        """(2,) extent of the bounding box, m."""
        return np.asarray(np.ptp(np.asarray(self.vertices), axis=0))

    def ends(self, side: int) -> tuple[Array, Array]:
        """The two corners of a side, (2,) each."""
        corners = np.asarray(self.vertices, dtype=float)
        return corners[side], corners[(side + 1) % len(corners)]

    def rotation(self, side: int) -> Array:
        """(2, 2) matrix that turns a table-frame vector into the side's ego frame."""
        c, s = self.normals[side]
        return np.array([[c, s], [-s, c]])


TABLES: dict[str, Table] = {
    "standard": Table.rectangle(1.6764, 0.6096),
    "full_size": Table.rectangle(1.9304, 0.8636),
    "ut_sysid": Table.rectangle(
        1.9304,
        0.8636,
        tilt=float(np.degrees(np.arcsin(0.687 / GRAVITY))),
        puck_damping=0.346,
    ),
}
"""Table presets: the 66 x 24 in workspace, the 76 x 34 in table, and that table with
the tilt and damping that the paper's authors identified."""

SeatKind = Literal["robot", "arcade"]
SEAT_KINDS: tuple[str, ...] = ("robot", "arcade")


@dataclass(frozen=True)
class Seat:
    """A place at the table: one paddle, what it can reach and how fast it can be."""

    side: int
    """The side of the table it belongs to."""
    reach: tuple[tuple[float, float], ...]
    """Convex polygon of the paddle's centre, ego frame, counter-clockwise, m."""
    speed: float
    """Top speed, m/s."""
    acceleration: float
    """Largest change of velocity, m/s2."""
    team: int = 0


def make_seat(
    kind: str, table: Table, side: int, others: tuple[int, ...] = (), team: int = 0
) -> Seat:
    """A seat of a kind at a side of a table.

    ``robot``: what a UR5e can hold with its base 0.22 m behind its edge, a box of
    0.42 x 0.50 m that begins 78 mm from the edge, with far corners cut at the slope of
    0.8 that the paper's authors use, as far as it lies in the side's territory.
    ``arcade``: all of the territory. Centres keep a paddle's radius inside of it.

    Args:
        kind: "robot" or "arcade".
        table: the table.
        side: which side of it.
        others: sides that other seats own; a territory ends half-way to them.
        team: the team that the seat plays for.
    """
    if kind not in SEAT_KINDS:
        raise ValueError(f"seats: {kind!r} is unknown; there are {SEAT_KINDS}")
    edge = -float(table.offsets[side])
    ego = table.rotation(side).T
    normals = table.normals @ ego
    if kind == "robot":
        near, far, wide, cut = edge + 0.0782, edge + 0.4982, 0.25, 0.08
        slope = cut / 0.8
        box = [
            (near, wide),
            (near, -wide),
            (far - cut, -wide),
            (far, -wide + slope),
            (far, wide - slope),
            (far - cut, wide),
        ]
        polygon, speed, acceleration = np.array(box), 0.7, 7.0
    else:
        polygon, speed, acceleration = np.asarray(table.vertices) @ ego, 2.5, 40.0
    for normal, offset in zip(normals, table.offsets, strict=True):
        polygon = clip(polygon, normal, offset - table.paddle_radius)
    own = np.array([1.0, 0.0])
    rivals = [other for other in others if other != side]
    for other in rivals:
        # Nearer to one's own side than to the other's, less the paddle's radius.
        toward, gap = normals[other] - own, table.offsets[other] - table.offsets[side]
        length = np.linalg.norm(toward)
        polygon = clip(polygon, toward / length, gap / length - table.paddle_radius)
    if not rivals and kind == "arcade":
        polygon = clip(polygon, -own, -table.paddle_radius)
    reach = tuple((float(x), float(y)) for x, y in polygon)
    return Seat(side, reach, speed, acceleration, team)


def clip(polygon: Array, normal: Array, offset: float) -> Array:
    """The part of a convex polygon (n, 2) where normal . point + offset >= 0."""
    distance = polygon @ normal + offset
    kept: list[Array] = []
    for here, there, a, b in zip(
        polygon,
        np.roll(polygon, -1, axis=0),
        distance,
        np.roll(distance, -1),
        strict=True,
    ):
        if a >= 0:
            kept.append(here)
        if a * b < 0:
            kept.append(here + (there - here) * a / (a - b))
    if len(kept) < 3:
        raise ValueError("reach: nothing of the polygon is left")
    return np.array(kept)


def half_planes(polygon: tuple[tuple[float, float], ...]) -> tuple[Array, Array]:
    """Inward unit normals (K, 2) and offsets (K,) of a counter-clockwise polygon.

    A point lies inside where ``normals @ point + offsets >= 0``.
    """
    corners = np.asarray(polygon, dtype=float)
    ahead = np.roll(corners, -1, axis=0) - corners
    length = np.linalg.norm(ahead, axis=-1, keepdims=True)
    if (length <= 0).any() or (_cross(ahead, np.roll(ahead, -1, axis=0)) < 0).any():
        raise ValueError("reach: must be a convex counter-clockwise polygon")
    normals = np.stack([-ahead[:, 1], ahead[:, 0]], -1) / length
    return normals, -np.einsum("kd,kd->k", normals, corners)


@cache
def reaches(table: Table, seats: tuple[Seat, ...]) -> tuple[Array, Array]:
    """Edges of the reaches of S seats in the table frame.

    Returns:
        Inward unit normals (S, K, 2), zero where a seat has fewer edges, and offsets
        (S, K) in metres, infinite there.
    """
    planes = [half_planes(seat.reach) for seat in seats]
    edges = max(len(offset) for _, offset in planes)
    normals = np.zeros((len(seats), edges, 2))
    offsets = np.full((len(seats), edges), np.inf)
    for s, (seat, (normal, offset)) in enumerate(zip(seats, planes, strict=True)):
        normals[s, : len(offset)] = normal @ table.rotation(seat.side)
        offsets[s, : len(offset)] = offset
    return normals, offsets
