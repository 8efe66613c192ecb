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
"""Gap below which two bodies are in contact if they hardly close (m)."""
TOUCH = 1e-6
"""Gap below which two bodies are in contact at any speed (m)."""
CREEP = 0.02
"""Closing speed above which bodies must come nearer than `NEAR`, to `TOUCH` (m/s)."""
OUTSIDE = 1e-9
"""Distance beyond the edge of its reach at which a paddle is outside (m)."""
RELEASE = 1e-3
"""Gap beyond which a contact has ended, so that the next one is a new one (m)."""

Distance = tuple[float, float, float]
"""Distance of a centre from the surface of a fixed object, or from another centre (m),
and the unit normal there."""


@inner(error_model="numpy", forceinline=True)
def in_contact(gap: float, speed: float) -> bool:
    """Return True if two bodies are in contact.

    Args:
        gap: between their surfaces, m.
        speed: at which it grows, m/s.
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
    """Return the distance from wall ``f`` of `make_walls`, a convex set."""
    nx, ny = walls[f, NORMAL_X], walls[f, NORMAL_Y]
    ahead = nx * x + ny * y + walls[f, OFFSET]
    if walls[f, HALF] == -np.inf:
        return ahead, nx, ny
    sign = walls[f, SIGN]
    aside = nx * (y - walls[f, MIDDLE_Y]) - ny * (x - walls[f, MIDDLE_X])
    gap = walls[f, HALF] - sign * aside
    if gap <= 0.0:
        return ahead, nx, ny
    # Beside the wall: its post or, behind the line, the end of the wall.
    distance, across, along = distance_to_point(max(ahead, 0.0), -sign * gap)
    return distance, across * nx - along * ny, across * ny + along * nx


@inner(error_model="numpy", forceinline=True)
def distance_to_fixed(
    x: float, y: float, f: int, walls: Array, obstacles: Array
) -> Distance:
    """Return the distance from a wall or, from ``len(walls)`` on, an obstacle."""
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
    """Return the distance ahead of the open goal line beside wall ``f``, m.

    It is below 0 for a centre that has crossed, and infinite beside the opening.
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
    """Return whether a paddle is within its reach, and whether its way stays there.

    Args:
        x: m.
        y: m.
        points: two points that its way lies between, from where it is, m.
        walls: see `make_walls`.
        low: first edge of the reach.
        high: the one after the last.
        radius: of the paddle, m.
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
    """Begin with pucks in play in some worlds, and find the walls that they touch.

    Args:
        worlds: (W,) indices.
        pucks: (B, pucks, 2) m.
        radius: of a puck, m.
        walls: see `make_walls`, like the next.
        wall_side: of each wall, -1 for edges of reaches.
        against: (B, pucks, sides) bool, filled in these worlds.
        out: (B, pucks) bool, like the next set to none.
        pinned: (B, pucks) s.
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
