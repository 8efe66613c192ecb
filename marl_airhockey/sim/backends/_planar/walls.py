"""Walls of backends: the lines of the sides, and the overlap of a disc with them."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array


def sides(scene: Scene) -> Array:
    """Return the sides of a scene's table (sides, 6) for compiled code, table frame.

    A row contains the inward normal, the distance of the side from the origin, its
    middle, and half the width of its goal line (0 without one). Lengths are in m.
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


@compiled()
def depth_in_side(lines: Array, s: int, radius: float, x: float, y: float) -> float:
    """Return the overlap of a disc with the wall of side ``s`` of `sides`, m."""
    nx, ny = lines[s, 0], lines[s, 1]
    if abs(nx * (y - lines[s, 4]) - ny * (x - lines[s, 3])) < lines[s, 5]:
        return -np.inf
    return float(radius - (nx * x + ny * y + lines[s, 2]))
