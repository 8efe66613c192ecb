"""Separation of overlapping discs that a solver with substeps cannot separate."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends._planar.walls import depth_in_side
from marl_airhockey.sim.core.limits import away
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array

SLOP = 2e-4
"""Largest overlap that is not corrected, m."""
PUSHES = 6
"""Number of sweeps in which only pucks move; then paddles move, too."""


@compiled()
def give_way(
    position: Array,
    velocity: Array,
    radius: Array,
    paddles: int,
    holds: Array,
    absent: Array,
    lines: Array,
    posts: Array,
) -> bool:
    """Separate overlapping discs: pucks yield first, then paddles, which stop.

    Args:
        position: Positions of paddles and pucks (N, 2), table frame, m, changed.
        velocity: Velocities of paddles (paddles, 2), table frame, m/s, changed. A
            paddle that yields loses its closing speed.
        radius: Radii of paddles and pucks (N,), m.
        paddles: Number of paddles.
        holds: True for paddles that do not yield (paddles,).
        absent: True for bodies that touch nothing (N,).
        lines: Sides of the table (sides, 6), see `walls.sides`.
        posts: Obstacles (obstacles, 5): both ends, and the smallest distance of a
            puck's centre, m.

    Returns:
        True if a body moved.
    """
    moved = False
    for sweep in range(40):
        deepest = 0.0
        for j in range(paddles, len(position)):
            if absent[j]:
                continue
            for s in range(len(lines)):
                x, y = position[j, 0], position[j, 1]
                deep = depth_in_side(lines, s, radius[j], x, y) - SLOP
                if deep > 0.0:
                    deepest = max(deepest, deep)
                    position[j, 0] += deep * lines[s, 0]
                    position[j, 1] += deep * lines[s, 1]
            for k in range(len(posts)):
                nx, ny, room = away(posts[k], position[j, 0], position[j, 1])
                deep = -room - SLOP
                if deep > 0.0:
                    deepest = max(deepest, deep)
                    position[j, 0] += deep * nx
                    position[j, 1] += deep * ny
            for i in range(j):
                nx = position[j, 0] - position[i, 0]
                ny = position[j, 1] - position[i, 1]
                gap = np.sqrt(nx * nx + ny * ny)
                deep = radius[i] + radius[j] - gap - SLOP
                if absent[i] or deep <= 0.0 or gap == 0.0:
                    continue
                deepest, nx, ny = max(deepest, deep), nx / gap, ny / gap
                # Share of the overlap by which the first body moves.
                share = 0.5 if i >= paddles else 0.0
                if i < paddles and sweep >= PUSHES and not holds[i]:
                    share = 1.0
                    closing = velocity[i, 0] * nx + velocity[i, 1] * ny
                    if closing > 0.0:
                        velocity[i, 0] -= closing * nx
                        velocity[i, 1] -= closing * ny
                position[i, 0] -= share * deep * nx
                position[i, 1] -= share * deep * ny
                position[j, 0] += (1.0 - share) * deep * nx
                position[j, 1] += (1.0 - share) * deep * ny
        if deepest < 1e-6:
            return moved
        moved = True
    return moved
