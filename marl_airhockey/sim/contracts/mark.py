"""Mark: a shape that is drawn on the table but is not a body."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

Meaning = Literal["goal", "reward", "cost", "drag"]


class Mark(NamedTuple):
    """Mark on the table: a goal, a region, a line, an arrow."""

    kind: Literal["circle", "line", "arrow"]
    start: tuple[float, float]
    """Centre or first end, m."""
    end: tuple[float, float] = (0.0, 0.0)
    """Second end, m."""
    radius: float = 0.0
    """Radius of a circle, m."""
    means: Meaning = "goal"
    """Meaning of a circle: a goal, or a region with a reward, a cost or a drag."""

    @staticmethod
    def circle(centre: Array, radius: float, means: Meaning = "goal") -> Mark:
        """Return a circle, m."""
        start = float(centre[0]), float(centre[1])
        return Mark("circle", start, radius=radius, means=means)

    @staticmethod
    def across(table: Table, x: float) -> Mark:
        """Return a line from one long side to the other, m."""
        wide = float(table.size[1]) / 2
        return Mark("line", (float(x), -wide), (float(x), wide))

    @staticmethod
    def arrow(start: Array, offset: Array) -> Mark:
        """Return an arrow from a point along an offset, m."""
        tip = np.asarray(start) + offset
        first = (float(start[0]), float(start[1]))
        return Mark("arrow", first, (float(tip[0]), float(tip[1])))
