"""Contacts of discs with walls, goal lines, obstacles and each other.

The laws are Chipmunk's, written for discs: positions move first, a contact uses the
velocity from before the pull of the slope, and corrects an overlap in the next substep.
The functions take scalars (m, m/s), which a compiler keeps in registers. A contact is
its depth (above 0 if they touch) and its unit normal.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.types import Array

SLOP = 1e-4
"""Overlap that a contact keeps, so that resting bodies stay in contact (m)."""


@njit(cache=True, error_model="numpy")
def bounce(before: float, now: float, restitution: float) -> float:
    """Return the normal speed that a contact adds, m/s.

    Args:
        before: normal speed before this substep's forces, m/s; below 0 if closing.
        now: normal speed after them, m/s.
        restitution: share of the closing speed that is returned.
    """
    return max(-(restitution * before + now), 0.0)


@njit(cache=True, error_model="numpy")
def penetration_correction(depth: float, taken: float) -> float:
    """Return the distance to add to the correction of an overlap, m."""
    return max(depth - SLOP - taken, 0.0)


@njit(cache=True, error_model="numpy")
def contact_disc(dx: float, dy: float, reach: float) -> tuple[float, float, float]:
    """Return depth and normal of two discs, the second (dx, dy) from the first."""
    square = dx * dx + dy * dy
    if square >= reach * reach:
        return -1.0, 1.0, 0.0
    distance = np.sqrt(square)
    if distance < 1e-9:
        return reach, 1.0, 0.0
    return reach - distance, dx / distance, dy / distance


@njit(cache=True, error_model="numpy")
def contact_side(
    x: float, y: float, radius: float, lines: Array, s: int
) -> tuple[float, float, float]:
    """Return depth and normal of a disc and side ``s`` of `walls.sides`."""
    nx, ny = lines[s, 0], lines[s, 1]
    ahead = nx * x + ny * y + lines[s, 2]
    if ahead >= radius:
        return -1.0, nx, ny
    half = lines[s, 5]
    aside = nx * (y - lines[s, 4]) - ny * (x - lines[s, 3])
    if abs(aside) >= half:
        return radius - ahead, nx, ny
    # Within the goal line: its nearer post or, behind the line, the wall beside it.
    gap = aside - (half if aside >= 0.0 else -half)
    depth, along, across = contact_disc(gap, max(ahead, 0.0), radius)
    return depth, across * nx - along * ny, across * ny + along * nx


@njit(cache=True, error_model="numpy")
def passes_line(x: float, y: float, lines: Array, s: int) -> bool:
    """Return True if a centre has passed the goal line in side ``s``."""
    nx, ny = lines[s, 0], lines[s, 1]
    aside = nx * (y - lines[s, 4]) - ny * (x - lines[s, 3])
    return bool(nx * x + ny * y + lines[s, 2] < 0.0 and abs(aside) < lines[s, 5])


@njit(cache=True, error_model="numpy")
def contact_obstacle(
    x: float, y: float, radius: float, obstacles: Array, o: int
) -> tuple[float, float, float]:
    """Return depth and normal of a disc and an obstacle, a row x, y, x, y, radius."""
    ax, ay = obstacles[o, 0], obstacles[o, 1]
    lx, ly = obstacles[o, 2] - ax, obstacles[o, 3] - ay
    square = lx * lx + ly * ly
    share = ((x - ax) * lx + (y - ay) * ly) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    dx, dy = x - ax - share * lx, y - ay - share * ly
    return contact_disc(dx, dy, radius + obstacles[o, 4])


@njit(cache=True, error_model="numpy")
def friction_share(speed: float, loss: float) -> float:
    """Return the share of a speed that Coulomb friction of ``loss`` m/s leaves."""
    return (speed - loss) / speed if speed > loss else 0.0


@njit(cache=True, error_model="numpy")
def cap(speed: float, most: float) -> float:
    """Return the share of a speed that leaves at most ``most``."""
    return most / speed if speed > most else 1.0


@njit(cache=True, error_model="numpy")
def find_leaning(
    worlds: Array, pucks: Array, radius: float, lines: Array, against: Array
) -> None:
    """Find the walls that pucks touch in some worlds.

    Args:
        worlds: (W,) indices.
        pucks: (B, pucks, 2) m.
        radius: of a puck, m.
        lines: `walls.sides`.
        against: (B, pucks, sides) bool, filled in these worlds.
    """
    for b in worlds:
        for k in range(pucks.shape[1]):
            for s in range(len(lines)):
                x, y = pucks[b, k, 0], pucks[b, k, 1]
                against[b, k, s] = contact_side(x, y, radius, lines, s)[0] > 0.0
