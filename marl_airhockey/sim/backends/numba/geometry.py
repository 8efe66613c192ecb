"""Geometry of contacts: distances and normals of discs, walls and obstacles."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.arrays import (
    HALF,
    MIDDLE_X,
    MIDDLE_Y,
    NORMAL_X,
    NORMAL_Y,
    OFFSET,
    SIGN,
)
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array

NEAR = 1e-4
"""Gap below which two bodies are in contact if they close at most at `CREEP`, m."""
TOUCH = 1e-6
"""Gap below which two bodies are in contact at any speed, m."""
CREEP = 0.02
"""Closing speed above which bodies are in contact only below `TOUCH`, m/s."""
OUTSIDE = 1e-9
"""Distance beyond the edge of its workspace from which on a paddle is outside, m."""
RELEASE = 1e-3
"""Gap above which a contact has ended, so that the next contact is a new one, m."""

Distance = tuple[float, float, float]
"""Distance of a centre from the surface of a fixed object or from another centre, m,
and the unit normal there."""


@inner(error_model="numpy", forceinline=True)
def in_contact(gap: float, speed: float) -> bool:
    """Return True if two bodies are in contact.

    Args:
        gap: Gap between their surfaces, m.
        speed: Time derivative of the gap, m/s.
    """
    return gap < TOUCH or (gap < NEAR and speed > -CREEP)


@inner(error_model="numpy", forceinline=True)
def distance_to_point(dx: float, dy: float) -> Distance:
    """Return the distance of a point (dx, dy) from the origin."""
    distance = np.sqrt(dx * dx + dy * dy)
    if distance < 1e-12:
        return 0.0, 1.0, 0.0
    return distance, dx / distance, dy / distance


@inner(error_model="numpy", forceinline=True)
def distance_to_wall(x: float, y: float, walls: Array, f: int) -> Distance:
    """Return the distance from wall ``f`` of `make_walls`, which is a convex set."""
    nx, ny = walls[f, NORMAL_X], walls[f, NORMAL_Y]
    ahead = nx * x + ny * y + walls[f, OFFSET]
    if walls[f, HALF] == -np.inf:
        return ahead, nx, ny
    sign = walls[f, SIGN]
    aside = nx * (y - walls[f, MIDDLE_Y]) - ny * (x - walls[f, MIDDLE_X])
    gap = walls[f, HALF] - sign * aside
    if gap <= 0.0:
        return ahead, nx, ny
    # Next to the wall: its post or, behind the line, the end of the wall.
    distance, across, along = distance_to_point(max(ahead, 0.0), -sign * gap)
    return distance, across * nx - along * ny, across * ny + along * nx


@inner(error_model="numpy", forceinline=True)
def distance_to_fixed(
    x: float, y: float, f: int, walls: Array, obstacles: Array
) -> Distance:
    """Return the distance from fixed object ``f``: walls are first, then obstacles."""
    if f < len(walls):
        return distance_to_wall(x, y, walls, f)
    o = f - len(walls)
    ax, ay = obstacles[o, 0], obstacles[o, 1]
    lx, ly = obstacles[o, 2] - ax, obstacles[o, 3] - ay
    square = lx * lx + ly * ly
    share = ((x - ax) * lx + (y - ay) * ly) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    distance, nx, ny = distance_to_point(x - ax - share * lx, y - ay - share * ly)
    return distance - obstacles[o, 4], nx, ny


@inner(error_model="numpy", forceinline=True)
def ahead_of_mouth(x: float, y: float, walls: Array, f: int) -> float:
    """Return the distance ahead of the open goal line next to wall ``f``, m.

    It is below 0 for a centre that has crossed the line, and infinite for a centre next
    to the opening.
    """
    nx, ny = walls[f, NORMAL_X], walls[f, NORMAL_Y]
    aside = nx * (y - walls[f, MIDDLE_Y]) - ny * (x - walls[f, MIDDLE_X])
    if not abs(aside) < walls[f, HALF] < np.inf:
        return np.inf
    return float(nx * x + ny * y + walls[f, OFFSET])


@inner(error_model="numpy", forceinline=True)
def stays_in_reach(
    x: float,
    y: float,
    points: tuple[float, float, float, float],
    walls: Array,
    low: int,
    high: int,
    radius: float,
) -> tuple[bool, bool]:
    """Return True if a paddle is in its workspace, and True if its path stays there.

    Args:
        x: Position of the centre along x, table frame, m.
        y: Position of the centre along y, table frame, m.
        points: Two displacements (x, y, x, y) that bound the path, m.
        walls: Walls, see `arrays.make_walls`.
        low: Index of the first edge of the workspace.
        high: Index after the last edge.
        radius: Radius of the paddle, m.
    """
    within, ahead = np.inf, np.inf
    for f in range(low, high):
        nx, ny = walls[f, NORMAL_X], walls[f, NORMAL_Y]
        here = nx * x + ny * y + walls[f, OFFSET] - radius
        way = min(nx * points[0] + ny * points[1], nx * points[2] + ny * points[3])
        within, ahead = min(within, here), min(ahead, here + way)
    return within > -OUTSIDE, ahead > -OUTSIDE


@compiled(error_model="numpy")
def begin_pucks(
    worlds: Array,
    pucks: Array,
    radius: float,
    walls: Array,
    wall_side: Array,
    against: Array,
    out: Array,
    pinned: Array,
) -> None:
    """Put all pucks into play in some worlds, and find the walls that they touch.

    Args:
        worlds: Indices of the worlds (W,).
        pucks: Positions of the pucks (B, pucks, 2), table frame, m.
        radius: Radius of a puck, m.
        walls: Walls, see `arrays.make_walls`.
        wall_side: Side of each wall, -1 for edges of workspaces.
        against: True if a puck touches a side (B, pucks, sides), filled.
        out: True for pucks out of play (B, pucks), set to False.
        pinned: Time for which pucks have been pinned (B, pucks), s, set to 0.
    """
    for b in worlds:
        for k in range(pucks.shape[1]):
            against[b, k], out[b, k], pinned[b, k] = False, False, 0.0
            for f in range(len(walls)):
                if wall_side[f] < 0:
                    continue
                x, y = pucks[b, k, 0], pucks[b, k, 1]
                near = distance_to_wall(x, y, walls, f)[0] < radius + NEAR
                against[b, k, wall_side[f]] |= near
