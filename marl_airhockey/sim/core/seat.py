"""Seat: one paddle at a side of the table, its workspace and its limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from marl_airhockey.sim.core.geometry import clip, half_planes, length, products
from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

SEAT_KINDS: tuple[str, ...] = ("robot", "arcade")


@dataclass(frozen=True)
class Seat:
    """Seat of one paddle: its side, its workspace, and its speed limits."""

    side: int
    """Index of the side of the table."""
    reach: tuple[tuple[float, float], ...]
    """Workspace of the paddle's centre: a convex polygon, counter-clockwise, ego frame,
    m."""
    speed: float
    """Top speed (m/s)."""
    acceleration: float
    """Largest acceleration (m/s2)."""
    team: int = 0


def make_seat(
    kind: str, table: Table, side: int, others: tuple[int, ...] = (), team: int = 0
) -> Seat:
    """Return a seat of a kind at a side of a table.

    A ``robot`` seat has the workspace and speed of a UR5e whose base is 0.22 m behind
    the side. The workspace is the part of the table's `robot_reach` that is inside the
    territory of the side. The workspace of an ``arcade`` seat is the whole territory,
    and its speed is that of a person's arm or a gantry. The centre of a paddle stays a
    paddle radius inside the territory.

    Args:
        kind: Kind of the seat, "robot" or "arcade".
        table: Table of the seat.
        side: Index of the side.
        others: Indices of the sides with other seats. A territory ends half-way to
            them.
        team: Team of the seat.
    """
    if kind not in SEAT_KINDS:
        raise ValueError(f"seats: {kind!r} is unknown; there are {SEAT_KINDS}")
    edge = -float(table.offsets[side])
    ego = table.rotation(side).T
    # The order starts at the own side, so opposite seats have the same numbers.
    count = len(table.vertices)
    order = [(side + k) % count for k in range(count)]
    normals = products(table.normals, ego.T)
    if kind == "robot":
        polygon, speed, acceleration = np.array(table.robot_reach), 0.7, 7.0
        polygon[:, 0] += edge
    else:
        polygon, speed, acceleration = (
            products(np.array(table.vertices)[order], ego.T),
            5.0,
            50.0,
        )
    for k in order:
        polygon = clip(polygon, normals[k], table.offsets[k] - table.paddle_radius)
    own = np.array([1.0, 0.0])
    rivals = [other for other in order[1:] if other in others]
    for other in rivals:
        # Points nearer to the own side than to the other, less the paddle's radius.
        toward, gap = normals[other] - own, table.offsets[other] - table.offsets[side]
        size = float(length(toward))
        polygon = clip(polygon, toward / size, gap / size - table.paddle_radius)
    if not rivals and kind == "arcade":
        polygon = clip(polygon, -own, -table.paddle_radius)
    reach = tuple((float(x), float(y)) for x, y in polygon)
    return Seat(side, reach, speed, acceleration, team)


@cache
def reaches(table: Table, seats: tuple[Seat, ...]) -> tuple[Array, Array]:
    """Return the edges of the workspaces of S seats in the table frame.

    Returns:
        Inward unit normals (S, K, 2) and offsets (S, K), m. Where a seat has fewer
        edges, normals are zero and offsets are infinite.
    """
    planes = [half_planes(seat.reach) for seat in seats]
    edges = max(len(offset) for _, offset in planes)
    normals = np.zeros((len(seats), edges, 2))
    offsets = np.full((len(seats), edges), np.inf)
    for s, (seat, (normal, offset)) in enumerate(zip(seats, planes, strict=True)):
        normals[s, : len(offset)] = products(normal, table.rotation(seat.side).T)
        offsets[s, : len(offset)] = offset
    return normals, offsets


OBSTACLE_MARGIN = 1e-3
"""Distance that paddles keep from obstacles (m). Braking in a wedge takes up to half of
it."""
OBSTACLE_SHARE = 0.5
"""Share of the acceleration that may be planned against one edge or obstacle."""


@dataclass(frozen=True)
class ReachPlanes:
    """Workspaces of S seats as half-planes in the table frame."""

    normals: Array
    """Inward unit normals (S, K, 2); zero where a seat has fewer edges."""
    offsets: Array
    """Offsets (S, K), m; infinite where a seat has fewer edges."""
    share: Array
    """Share of the acceleration that may be planned against one edge (S,). Braking
    against both edges of a corner together then stays within the limit."""
    rotation: Array
    """Rotations from the table frame to each seat's ego frame (S, 2, 2)."""
    obstacles: Array
    """Obstacles (O, 5): both ends, and the distance that the centres of paddles keep
    from them, m."""
    passes: int
    """Number of projections. It is 1 unless a corner is sharper than 90 degrees or
    there are obstacles."""

    @staticmethod
    def of(table: Table, seats: tuple[Seat, ...]) -> ReachPlanes:
        """Return the half-planes of the seats of a table."""
        normals, offsets = reaches(table, seats)
        share, sharpest = np.ones(len(seats)), 1.0
        for s, seat in enumerate(seats):
            normal, _ = half_planes(seat.reach)
            cosine = (normal * np.roll(normal, -1, axis=0)).sum(-1).min()
            share[s] = np.sqrt((1 + cosine) / 2)
            sharpest = min(sharpest, cosine)
        rotation = np.array([table.rotation(seat.side) for seat in seats])
        near = table.paddle_radius + OBSTACLE_MARGIN
        rows = [
            (*o.start, *(o.end or o.start), o.radius + near) for o in table.obstacles
        ]
        obstacles = np.array(rows, float).reshape(-1, 5)
        # Braking against an obstacle and an edge is planned as in a corner.
        share = np.minimum(share, OBSTACLE_SHARE) if rows else share
        passes = 1 if sharpest > -1e-9 and not rows else 12
        return ReachPlanes(normals, offsets, share, rotation, obstacles, passes)
