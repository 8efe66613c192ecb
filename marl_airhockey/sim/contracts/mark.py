"""Marks and captions: shapes and texts on the image of a table.

Like the rules, they are written for arrays with any leading axes (...). They can
therefore be compiled and exported together with the rules.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

Meaning = Literal["goal", "reward", "cost", "drag"]


@dataclass(frozen=True)
class Mark:
    """Mark on the table: a goal, a region, a line, an arrow."""

    kind: Literal["circle", "line", "arrow"]
    start: Array
    """Centre or first end (..., 2), m."""
    end: Array
    """Second end (..., 2), m; the centre of a circle."""
    radius: float = 0.0
    """Radius of a circle, m."""
    means: Meaning = "goal"
    """Meaning of a circle: a goal, or a region with a reward, a cost or a drag."""
    shown: Array | bool = True
    """(...) bool: the mark is visible."""

    @property
    def numbers(self) -> tuple[float, ...]:
        """Both ends and the radius of the mark of one world, m."""
        return (*map(float, self.start), *map(float, self.end), self.radius)

    @staticmethod
    def circle(
        centre: Array,
        radius: float,
        means: Meaning = "goal",
        shown: Array | bool = True,
    ) -> Mark:
        """Return a circle with a centre (..., 2) and a radius, m."""
        return Mark("circle", centre, centre, radius, means, shown)

    @staticmethod
    def across(table: Table, x: Array, shown: Array | bool = True) -> Mark:
        """Return a line at x (...) from one long side to the other, m."""
        wide = float(table.size[1]) / 2
        ends = [np.stack([x, np.full_like(x, y)], -1) for y in (-wide, wide)]
        return Mark("line", ends[0], ends[1], shown=shown)

    @staticmethod
    def arrow(start: Array, offset: Array) -> Mark:
        """Return an arrow from a point (..., 2) along an offset (..., 2), m."""
        return Mark("arrow", start, start + offset)


class Caption:
    """Text with numbers, such as a score.

    Args:
        text: Text with a format such as ``{:.0f}`` for each number.
        numbers: Numbers (...). An infinite number is unknown, and shown as a dash.
    """

    def __init__(self, text: str, *numbers: Array | float) -> None:
        self.text, self.numbers = text, numbers

    def __str__(self) -> str:
        """Return the text of one world."""
        return self.text.format(*(_Number(number) for number in self.numbers))


class _Number(float):
    def __format__(self, kind: str) -> str:
        return format(float(self), kind) if np.isfinite(self) else "-"
