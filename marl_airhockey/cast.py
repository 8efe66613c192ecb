"""Who and what is on the table: the static side of a scenario."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from marl_airhockey.state import Array, Bodies
from marl_airhockey.table import Seat, Table


@dataclass(frozen=True)
class Mouth:
    """A goal mouth in the middle of a side, or (``width`` None) the whole side.

    A puck crosses a goal mouth when its centre passes the side's line there; it crosses
    a mouth that is a whole side when it touches that wall.
    """

    name: str
    side: int
    width: float | None = None
    """m"""


@dataclass(frozen=True)
class Obstacle:
    """A static disc, or a rounded segment if ``end`` is given."""

    start: tuple[float, float]
    radius: float
    end: tuple[float, float] | None = None


@dataclass(frozen=True)
class Cast:
    """Seats, bodies and mouths of a scenario on its table.

    Raises:
        ValueError: a body that does not fit, naming the field.
    """

    table: Table
    seats: tuple[Seat, ...]
    pucks: int = 0
    blocks: int = 0
    block_radius: float = 0.0377
    """m; half the side of a square"""
    block_shape: Literal["disc", "square"] = "disc"
    obstacles: tuple[Obstacle, ...] = ()
    mouths: tuple[Mouth, ...] = ()
    path: bool = False
    """True if scenarios need positions at every substep."""
    physics: dict[str, float] = field(default_factory=dict, hash=False)
    """Physical parameters that this scenario sets, by name."""

    def __post_init__(self) -> None:
        if not self.seats:
            raise ValueError("cast.seats: at least one seat is needed")
        if self.pucks < 0 or self.blocks < 0:
            raise ValueError("cast: pucks and blocks must not be negative")
        if not 0 < self.block_radius < self.table.offsets.min():
            raise ValueError(f"cast.block_radius: {self.block_radius} m does not fit")
        if self.block_shape not in ("disc", "square"):
            raise ValueError(f"cast.block_shape: {self.block_shape!r} is not known")
        for mouth in self.mouths:
            start, end = self.table.ends(mouth.side)
            length = float(((end - start) ** 2).sum() ** 0.5)
            if mouth.width is not None and not 0 < mouth.width < length:
                raise ValueError(f"cast.mouths: {mouth.name!r} is wider than its side")

    def opening(self, mouth: Mouth) -> Array:
        """(2, 2) ends of a mouth, in the order of its side's, m."""
        start, end = self.table.ends(mouth.side)
        if mouth.width is None:
            return np.array([start, end])
        along = (end - start) / np.linalg.norm(end - start) * mouth.width / 2
        middle = (start + end) / 2
        return np.array([middle - along, middle + along])

    @cached_property
    def bodies(self) -> Bodies:
        """Kinds and radii of all bodies, sorted by kind."""
        radius = (
            (self.table.paddle_radius,) * len(self.seats)
            + (self.table.puck_radius,) * self.pucks
            + (self.block_radius,) * self.blocks
            + tuple(o.radius for o in self.obstacles)
        )
        counts = (self.pucks, self.blocks, len(self.obstacles))
        return Bodies(len(self.seats), *counts, radius)

    def mouth(self, name: str) -> int:
        """Index of the mouth with this name."""
        return [m.name for m in self.mouths].index(name)

    @cached_property
    def defaults(self) -> dict[str, float]:
        """Physical parameters that follow from table, scenario and seats."""
        seat = self.seats[0]
        motion = {"paddle_speed": seat.speed, "paddle_acceleration": seat.acceleration}
        return {**self.table.physics, **self.physics, **motion}
