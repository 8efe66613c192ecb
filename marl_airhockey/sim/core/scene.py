"""Scene: seats, bodies and goal lines on a table, the static part of a scenario."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from marl_airhockey.sim.core.geometry import length
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.core.state import Bodies, State
from marl_airhockey.sim.core.table import Obstacle, Table
from marl_airhockey.types import Array


@dataclass(frozen=True)
class GoalLine:
    """Goal line in the middle of a side, or the whole side if ``width`` is None.

    A puck crosses a goal line when its centre passes the line of the side there. It
    crosses a goal line that is a whole side when it touches that wall.
    """

    name: str
    side: int
    width: float | None = None
    """Width (m); None for the whole side."""


@dataclass(frozen=True)
class Scene:
    """Seats, bodies and goal lines of a scenario on its table.

    Raises:
        ValueError: A body does not fit. The message names the field.
    """

    table: Table
    seats: tuple[Seat, ...]
    pucks: int = 0
    blocks: int = 0
    block_radius: float = 0.0377
    """Radius of a disc, or half the side of a square (m)."""
    block_shape: Literal["disc", "square"] = "disc"
    goal_lines: tuple[GoalLine, ...] = ()
    path: bool = False
    """True if the scenario needs positions at every substep."""
    physics: dict[str, float] = field(default_factory=dict, hash=False)
    """Physical parameters that the scenario sets, by name."""

    def __post_init__(self) -> None:
        if not self.seats:
            raise ValueError("scene.seats: at least one seat is needed")
        if self.pucks < 0 or self.blocks < 0:
            raise ValueError("scene: pucks and blocks must not be negative")
        if not 0 < self.block_radius < self.table.offsets.min():
            raise ValueError(f"scene.block_radius: {self.block_radius} m does not fit")
        if self.block_shape not in ("disc", "square"):
            raise ValueError(f"scene.block_shape: {self.block_shape!r} is not known")
        for goal_line in self.goal_lines:
            start, end = self.table.ends(goal_line.side)
            length = float(((end - start) ** 2).sum() ** 0.5)
            if goal_line.width is not None and not 0 < goal_line.width < length:
                raise ValueError(
                    f"scene.goal_lines: {goal_line.name!r} is {goal_line.width:g} m "
                    f"wide; that must be between 0 and the {length:.3g} m of its side"
                )

    def opening(self, goal_line: GoalLine) -> Array:
        """Return the ends (2, 2) of a goal line, ordered as the ends of its side, m."""
        start, end = self.table.ends(goal_line.side)
        if goal_line.width is None:
            return np.array([start, end])
        along = (end - start) / length(end - start) * goal_line.width / 2
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

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Obstacles on the table."""
        return self.table.obstacles

    def goal_line(self, name: str) -> int:
        """Return the index of the goal line with a name."""
        return [m.name for m in self.goal_lines].index(name)

    def still_state(self, worlds: int) -> State:
        """Return a state with movable bodies at rest at the origin, without contacts.

        Obstacles are at their positions. The arrays are freshly allocated.
        """
        bodies, count = self.bodies, len(self.bodies)
        pucks, pairs = (worlds, bodies.pucks), (worlds, bodies.paddles, bodies.pucks)
        lines, sides = len(self.goal_lines), len(self.table.vertices)
        position = np.zeros((worlds, count, 2))
        for i, obstacle in enumerate(self.obstacles, start=bodies.movers):
            position[:, i] = obstacle.start
        return State(
            bodies=bodies,
            position=position,
            velocity=np.zeros((worlds, count, 2)),
            angle=np.zeros((worlds, count)),
            spin=np.zeros((worlds, count)),
            touched=np.zeros(pairs, np.int64),
            touched_at=np.full(pairs, np.nan),
            touching=np.zeros(pairs, np.bool_),
            banked=np.zeros((*pucks, sides), np.int16),
            crossed=np.zeros((*pucks, lines), np.bool_),
            crossed_velocity=np.zeros((*pucks, lines, 2)),
            lifted=np.zeros(pucks, np.bool_),
            visible=np.ones(pucks, np.bool_),
            time=np.zeros(worlds),
        )

    @cached_property
    def defaults(self) -> dict[str, float]:
        """Physical parameters that table, scenario and seats set, by name."""
        seat = self.seats[0]
        motion = {"paddle_speed": seat.speed, "paddle_acceleration": seat.acceleration}
        return {**self.table.physics, **self.physics, **motion}
