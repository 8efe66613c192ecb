"""State of B worlds: what every backend reports and every scenario reads.

Axes are named from the right, ``(..., bodies, 2)``. What stands to the left belongs to
the caller: nothing, ``(B,)`` worlds, or ``(T, B)`` a stored dataset.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

from marl_airhockey.types import Array


class Kind(IntEnum):
    """Kind of a body; bodies are sorted by kind."""

    PADDLE = 0
    PUCK = 1
    BLOCK = 2
    OBSTACLE = 3


@dataclass(frozen=True)
class Bodies:
    """Static side of a state: number of bodies of each kind, and their sizes."""

    paddles: int
    pucks: int
    blocks: int
    obstacles: int
    radius: tuple[float, ...]
    """Radius of each body in metres; half the side of a square block."""

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
        """Number of bodies that can move: all but the obstacles."""
        return self.paddles + self.pucks + self.blocks

    def __len__(self) -> int:
        return len(self.radius)


@dataclass(frozen=True)
class State:
    """All bodies at one moment, in the table frame (or a seat's ego frame), SI units.

    The contact fields tell what happened since the state before this one.
    """

    bodies: Bodies
    position: Array
    """(..., N, 2) m"""
    velocity: Array
    """(..., N, 2) m/s"""
    angle: Array
    """(..., N) rad"""
    spin: Array
    """(..., N) rad/s"""
    touched: Array
    """(..., paddles, pucks) contacts that began in the step"""
    touched_at: Array
    """(..., paddles, pucks) s into the step of the last one that began, nan if none"""
    touching: Array
    """(..., paddles, pucks) in contact at the end of the step"""
    banked: Array
    """(..., pucks, sides) bounces off each side of the table that began in the step"""
    crossed: Array
    """(..., pucks, goal_lines) bool: passed it, or touched one that is a whole side"""
    crossed_velocity: Array
    """(..., pucks, goal_lines, 2) m/s of the puck as it crossed"""
    visible: Array
    """(..., pucks) bool: seen by the sensor"""
    time: Array
    """(...) s since the start of the episode"""
    path: Array | None = None
    """(..., K + 1, movers, 4) x, y, vx, vy at every substep, if the scene wants it"""

    @property
    def paddle(self) -> Array:
        """(..., paddles, 2) positions, m."""
        return self.position[..., self.bodies.paddle, :]

    @property
    def paddle_velocity(self) -> Array:
        """(..., paddles, 2) m/s."""
        return self.velocity[..., self.bodies.paddle, :]

    @property
    def puck(self) -> Array:
        """(..., pucks, 2) positions, m."""
        return self.position[..., self.bodies.puck, :]

    @property
    def puck_velocity(self) -> Array:
        """(..., pucks, 2) m/s."""
        return self.velocity[..., self.bodies.puck, :]

    @property
    def block(self) -> Array:
        """(..., blocks, 2) positions, m."""
        return self.position[..., self.bodies.block, :]

    @property
    def block_velocity(self) -> Array:
        """(..., blocks, 2) m/s."""
        return self.velocity[..., self.bodies.block, :]

    def map(self, change: Callable[[Array], Array]) -> State:
        """Return the state with ``change`` applied to every array, as picking rows."""
        arrays: dict[str, Any] = {n: change(getattr(self, n)) for n in ARRAYS}
        if self.path is not None:
            arrays["path"] = change(self.path)
        return replace(self, **arrays)

    def write(self, worlds: Array, rows: State) -> None:
        """Copy the `RESULTS` of ``rows`` (W, ...) into some worlds (W,), by index.

        The path becomes that of bodies that have been there all along.
        """
        for name in RESULTS:
            getattr(self, name)[worlds] = getattr(rows, name)
        if self.path is not None:
            both = np.concatenate([rows.position, rows.velocity], -1)
            self.path[worlds] = both[:, None, : self.bodies.movers]


ARRAYS = tuple(f.name for f in fields(State) if f.name not in ("bodies", "path"))
"""Names of the fields that every state has."""
EVENTS = (
    *("touched", "touched_at", "touching", "banked"),
    *("crossed", "crossed_velocity"),
)
"""Names of the fields that tell what happened in a step."""
RESULTS = ("position", "velocity", "angle", "spin", "time", *EVENTS)
"""Names of the fields that every step of every backend writes."""
