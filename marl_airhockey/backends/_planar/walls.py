"""Walls of 2D backends: their lines, and the release of squeezed pucks."""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.core.scene import Scene
from marl_airhockey.types import Array

SQUEEZE = 0.002
"""Depth in a wall from which a puck that a paddle pushes is released (m)."""


def sides(scene: Scene) -> Array:
    """Return the sides of a scene's table (sides, 6), in the form for compiled code.

    A row holds the inward normal, the side's distance from the origin, its middle, and
    half the width of the goal line in it (0 for none), in metres.
    """
    table, rows = scene.table, []
    for side, (normal, offset) in enumerate(
        zip(table.normals, table.offsets, strict=True)
    ):
        start, end = table.ends(side)
        widths = [m.width or 0.0 for m in scene.goal_lines if m.side == side]
        half = max(widths, default=0.0) / 2
        rows.append([*normal, offset, *(start + end) / 2, half])
    return np.array(rows)


@njit(cache=True)
def wall(lines: Array, radius: float, x: float, y: float, depth: float) -> int:
    """Return the side whose wall a puck is deeper in than ``depth`` (m); -1 if none."""
    for k in range(len(lines)):
        nx, ny = lines[k, 0], lines[k, 1]
        if nx * x + ny * y + lines[k, 2] - radius < -depth:
            aside = nx * (y - lines[k, 4]) - ny * (x - lines[k, 3])
            if abs(aside) >= lines[k, 5]:
                return k
    return -1


@njit(cache=True)
def inside(lines: Array, radius: float, x: float, y: float) -> tuple[float, float]:
    """Move a point out of the walls; twice, for a corner."""
    for _ in range(2):
        k = wall(lines, radius, x, y, 0.0)
        if k >= 0:
            nx, ny, offset = lines[k, 0], lines[k, 1], lines[k, 2]
            into = nx * x + ny * y + offset - radius
            x, y = x - into * nx, y - into * ny
    return x, y


@njit(cache=True)
def slide_out(
    lines: Array, radius: float, x: float, y: float, paddles: Array, touch: float
) -> tuple[float, float]:
    """Move a puck that paddles squeeze into a wall away along the wall.

    Neither wall nor paddle yields to a solver, which would push the puck into the
    wall; in a corner the paddle is allowed to overlap it.

    Args:
        lines: result of `sides`.
        radius: radius of the puck, m.
        x: position of the puck, m.
        y: position of the puck, m.
        paddles: positions (paddles, 2), m.
        touch: distance of the centres of puck and paddle in contact, m.

    Returns:
        New position x, y of the puck, m.
    """
    k = wall(lines, radius, x, y, SQUEEZE)
    if k < 0:
        return x, y
    nx, ny = lines[k, 0], lines[k, 1]
    x, y = inside(lines, radius, x, y)
    for i in range(len(paddles)):
        px, py = paddles[i, 0], paddles[i, 1]
        gap, aside = nx * (x - px) + ny * (y - py), nx * (y - py) - ny * (x - px)
        if gap * gap + aside * aside < touch * touch:
            way = np.sqrt(touch * touch - gap * gap)
            shift = (way if aside >= 0.0 else -way) - aside
            x, y = x - shift * ny, y + shift * nx
    return inside(lines, radius, x, y)
