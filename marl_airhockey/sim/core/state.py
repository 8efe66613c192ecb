"""State of B worlds: the output of every backend and the input of every scenario.

Axes are named from the right, ``(..., bodies, 2)``. The axes to the left belong to the
caller: none, ``(B,)`` for worlds, or ``(T, B)`` for a stored dataset.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np

from marl_airhockey.sim.core.rows import copy_rows
from marl_airhockey.types import Array


class Kind(IntEnum):
    """Kind of a body; bodies are sorted by kind."""

    PADDLE = 0
    PUCK = 1
    BLOCK = 2
    OBSTACLE = 3


@dataclass(frozen=True)
class Bodies:
    """Static part of a state: number of bodies of each kind, and their sizes."""

    paddles: int
    pucks: int
    blocks: int
    obstacles: int
    radius: tuple[float, ...]
    """Radius of each body, or half the side of a square block (m)."""

    @cached_property
    def kind(self) -> tuple[Kind, ...]:
        """Kind of each body, sorted."""
        counts = (self.paddles, self.pucks, self.blocks, self.obstacles)
        return tuple(k for k, n in zip(Kind, counts, strict=True) for _ in range(n))

    @cached_property
    def paddle(self) -> slice:
        """Indices of the paddles."""
        return slice(0, self.paddles)

    @cached_property
    def puck(self) -> slice:
        """Indices of the pucks."""
        return slice(self.paddles, self.paddles + self.pucks)

    @cached_property
    def block(self) -> slice:
        """Indices of the blocks."""
        first = self.paddles + self.pucks
        return slice(first, first + self.blocks)

    @property
    def movers(self) -> int:
        """Number of bodies that can move: all except the obstacles."""
        return self.paddles + self.pucks + self.blocks

    def __len__(self) -> int:
        return len(self.radius)


@dataclass(frozen=True)
class State:
    """State of all bodies at one time, table frame (or a seat's ego frame), SI units.

    The contact fields hold the events since the previous state.
    """

    bodies: Bodies
    position: Array
    """Positions (..., N, 2), m."""
    velocity: Array
    """Velocities (..., N, 2), m/s."""
    angle: Array
    """Orientations (..., N), rad."""
    spin: Array
    """Angular velocities (..., N), rad/s."""
    touched: Array
    """Number of contacts that began in the step (..., paddles, pucks)."""
    touched_at: Array
    """Time into the step at which the last of these contacts began
    (..., paddles, pucks), s; nan without a contact. It is below 0 on a real table,
    where contacts are observed with latency."""
    touching: Array
    """True for a contact at the end of the step (..., paddles, pucks)."""
    banked: Array
    """Number of bounces off each side that began in the step (..., pucks, sides)."""
    crossed: Array
    """True if the puck passed the goal line, or touched a goal line that is a whole
    side (..., pucks, goal_lines)."""
    crossed_velocity: Array
    """Velocity of the puck when it crossed (..., pucks, goal_lines, 2), m/s."""
    lifted: Array
    """True if the puck was taken off the table because a position-driven paddle left it
    no space (..., pucks)."""
    visible: Array
    """True if the sensor detects the puck (..., pucks)."""
    time: Array
    """Time since the start of the episode (...), s."""
    path: Array | None = None
    """Columns x, y, vx, vy at every substep (..., K + 1, movers, 4); None unless the
    scene requires it. On a real table the puck's path ends at the newest frame."""

    @property
    def paddle(self) -> Array:
        """Positions of the paddles (..., paddles, 2), m."""
        return self.position[..., self.bodies.paddle, :]

    @property
    def paddle_velocity(self) -> Array:
        """Velocities of the paddles (..., paddles, 2), m/s."""
        return self.velocity[..., self.bodies.paddle, :]

    @property
    def puck(self) -> Array:
        """Positions of the pucks (..., pucks, 2), m."""
        return self.position[..., self.bodies.puck, :]

    @property
    def puck_velocity(self) -> Array:
        """Velocities of the pucks (..., pucks, 2), m/s."""
        return self.velocity[..., self.bodies.puck, :]

    @property
    def puck_edge(self) -> Array:
        """Speeds of the pucks' edges by their spin (..., pucks), m/s."""
        pucks = self.bodies.puck
        radius = np.array(self.bodies.radius[pucks])
        return np.asarray(radius * self.spin[..., pucks])

    @property
    def block(self) -> Array:
        """Positions of the blocks (..., blocks, 2), m."""
        return self.position[..., self.bodies.block, :]

    @property
    def block_velocity(self) -> Array:
        """Velocities of the blocks (..., blocks, 2), m/s."""
        return self.velocity[..., self.bodies.block, :]

    def map(self, change: Callable[[Array], Array]) -> State:
        """Return the state with a function, such as indexing, applied to all arrays.

        Args:
            change: Function of an array.
        """
        arrays: dict[str, Any] = {n: change(getattr(self, n)) for n in ARRAYS}
        if self.path is not None:
            arrays["path"] = change(self.path)
        return replace(self, **arrays)

    def write(self, worlds: Array, rows: State) -> None:
        """Copy the `RESULTS` of ``rows`` (W, ...) into some worlds (W,), by index.

        The path becomes that of bodies that were there during the whole step.
        """
        count = len(self.time)
        pairs = [
            (x.reshape(count, -1), row.reshape(len(worlds), -1))
            for x, row in zip(_results(self), _results(rows), strict=True)
        ]
        copy_rows(worlds, tuple(pairs))
        if self.path is not None:
            both = np.concatenate([rows.position, rows.velocity], -1)
            self.path[worlds] = both[:, None, : self.bodies.movers]


ARRAYS = tuple(f.name for f in fields(State) if f.name not in ("bodies", "path"))
"""Names of the fields that every state has."""
EVENTS = (
    *("touched", "touched_at", "touching", "banked"),
    *("crossed", "crossed_velocity", "lifted"),
)
"""Names of the fields that hold the events of a step."""
RESULTS = ("position", "velocity", "angle", "spin", "time", *EVENTS)
"""Names of the fields that every step of every backend writes."""
_results = attrgetter(*RESULTS)
