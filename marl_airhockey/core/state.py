"""What every backend reports and every scenario reads: arrays of bodies on a table.

Axes are named from the right, ``(..., bodies, 2)``. What stands to the left belongs to
the caller: nothing, ``(B,)`` worlds, or ``(T, B)`` a stored dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

from marl_airhockey.types import Array


class Kind(IntEnum):
    """What a body is; bodies are sorted by kind."""

    PADDLE = 0
    PUCK = 1
    BLOCK = 2
    OBSTACLE = 3


@dataclass(frozen=True)
class Bodies:
    """The static side of a state: how many bodies of each kind, and how large."""

    paddles: int
    pucks: int
    blocks: int
    obstacles: int
    radius: tuple[float, ...]
    """Radius of each body in metres; half the side of a square block."""

    @cached_property
    def kind(self) -> tuple[Kind, ...]:
        """The kind of each body, sorted."""
        counts = (self.paddles, self.pucks, self.blocks, self.obstacles)
        return tuple(k for k, n in zip(Kind, counts, strict=True) for _ in range(n))

    @cached_property
    def paddle(self) -> slice:
        """Where the paddles are."""
        return slice(0, self.paddles)

    @cached_property
    def puck(self) -> slice:
        """Where the pucks are."""
        return slice(self.paddles, self.paddles + self.pucks)

    @cached_property
    def block(self) -> slice:
        """Where the blocks are."""
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

    The contact fields tell what happened since the state before this one. What only
    one backend knows lives in ``extra``, which scenarios do not read.
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
    crossed: Array
    """(..., pucks, goal_lines) bool: went through, or touched a goal line that is a wall"""
    crossed_velocity: Array
    """(..., pucks, goal_lines, 2) m/s of the puck as it crossed"""
    visible: Array
    """(..., pucks) bool: seen by the sensor"""
    time: Array
    """(...) s since the start of the episode"""
    path: Array | None = None
    """(..., K + 1, movers, 4) x, y, vx, vy at every substep, if the scene asks for it"""
    extra: Mapping[str, Array] = field(default_factory=dict)

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
        """The state with ``change`` applied to every array: pick rows, stack times."""
        arrays: dict[str, Any] = {n: change(getattr(self, n)) for n in ARRAYS}
        if self.path is not None:
            arrays["path"] = change(self.path)
        extra = {name: change(value) for name, value in self.extra.items()}
        return replace(self, **arrays, extra=extra)

    def replaced(self, fields: Mapping[str, Any]) -> State:
        """A state with some fields anew and all else shared; cheaper than `replace`."""
        new = object.__new__(State)
        new.__dict__.update(self.__dict__)
        new.__dict__.update(fields)
        return new

    def write(self, worlds: Array, rows: State, shared: State) -> State:
        """The state with ``rows`` in some worlds (W,), by index, and no path.

        Its own arrays are changed in place; one that it shares with ``shared`` is
        copied first, if it has to change.
        """
        new = self.replaced({"path": None})
        for name in ARRAYS:
            array, value = getattr(self, name), getattr(rows, name)
            if array is getattr(shared, name):
                if np.array_equal(array[worlds], value):
                    continue
                array = array.copy()
                vars(new)[name] = array
            array[worlds] = value
        return new


ARRAYS = tuple(
    f.name for f in fields(State) if f.name not in ("bodies", "path", "extra")
)


EVENTS = ("touched", "touched_at", "touching", "crossed", "crossed_velocity")
"""The arrays that tell what happened in a step."""


RESULTS = ("position", "velocity", "time", *EVENTS)
"""The arrays that every step of every backend makes anew."""


def still_state(bodies: Bodies, worlds: int, goal_lines: int) -> State:
    """``worlds`` rows with every body at the origin, at rest, and no contact.

    Args:
        bodies: the scene's bodies.
        worlds: number of rows.
        goal_lines: number of goal lines in the scene.
    """
    pucks, pairs = (worlds, bodies.pucks), (worlds, bodies.paddles, bodies.pucks)
    n = len(bodies)
    return State(
        bodies=bodies,
        position=np.zeros((worlds, n, 2)),
        velocity=np.zeros((worlds, n, 2)),
        angle=np.zeros((worlds, n)),
        spin=np.zeros((worlds, n)),
        touched=np.zeros(pairs, np.int64),
        touched_at=np.full(pairs, np.nan),
        touching=np.zeros(pairs, np.bool_),
        crossed=np.zeros((*pucks, goal_lines), np.bool_),
        crossed_velocity=np.zeros((*pucks, goal_lines, 2)),
        visible=np.ones(pucks, np.bool_),
        time=np.zeros(worlds),
    )
