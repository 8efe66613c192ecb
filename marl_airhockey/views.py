"""Observation pieces: what a seat is shown, with bounds, labels and typical sizes.

A scenario lists pieces; spaces, labels and scales follow from them. Vectors are in the
seat's ego frame, SI units.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from marl_airhockey.cast import Cast
from marl_airhockey.physics import PUCK_SPEED_CAP, unknown
from marl_airhockey.rewards import touched
from marl_airhockey.state import Array, Memory, State

OBSERVE = ("velocity", "history", "pixels")
"""What is shown of a puck: position and velocity; the last five sensed positions with a
visibility flag, as a camera gives them; or pictures."""
HISTORY = 5
FRAMES = 3


class Column(NamedTuple):
    """One element of an observation.

    ``(value - centre) / unit`` is of order one: the fixed scaling for a network.
    """

    label: str
    low: float
    high: float
    unit: float
    centre: float = 0.0


@dataclass(frozen=True)
class Scope:
    """What pieces need to know to state their columns."""

    cast: Cast
    observe: str
    top_speed: float

    @cached_property
    def extent(self) -> Array:
        """(2,) largest |x| and |y| of the table in any seat's ego frame, m."""
        corners = np.asarray(self.cast.table.vertices)
        turned = [corners @ r.T for r in self.rotations]
        return np.asarray(np.max(np.abs(turned), axis=(0, 1)))

    @cached_property
    def rotations(self) -> Array:
        """(S, 2, 2) from the table frame to each seat's ego frame."""
        return np.array([self.cast.table.rotation(s.side) for s in self.cast.seats])

    @property
    def shown(self) -> int:
        """Numbers shown of each puck."""
        return 4 if self.observe == "velocity" else 3 * HISTORY

    def place(
        self, name: str, unit: tuple[float, float], x: float = 0.0
    ) -> list[Column]:
        """Columns of a position, centred at (x, 0)."""
        ex, ey = self.extent
        return [
            Column(f"{name}.x", -ex, ex, unit[0], x),
            Column(f"{name}.y", -ey, ey, unit[1]),
        ]

    def gap(self, name: str, unit: tuple[float, float]) -> list[Column]:
        """Columns of the way from one position to another."""
        ex, ey = 2 * self.extent
        return [
            Column(f"{name}.dx", -ex, ex, unit[0]),
            Column(f"{name}.dy", -ey, ey, unit[1]),
        ]

    def motion(self, name: str, most: float, unit: float) -> list[Column]:
        """Columns of a velocity."""
        return [Column(f"{name}.v{axis}", -most, most, unit) for axis in "xy"]


class Ego:
    """A sensed state and the scenario's memory, seen from every seat."""

    def __init__(self, state: State, memory: Memory, history: Array, scope: Scope):
        self.state, self.memory = state, memory
        self.history = history
        """(..., HISTORY, pucks, 3) sensed positions and visibility, newest last"""
        self.scope = scope
        self._straight = scope.rotations.shape[0] == 1 and bool(
            scope.rotations[0, 0, 0] == 1.0
        )

    def turn(self, vectors: Array) -> Array:
        """(..., n, 2) vectors of the table frame to (..., S, n, 2) in ego frames."""
        seats = vectors[..., None, :, :]
        if self._straight:
            return seats
        return np.asarray(seats @ self.scope.rotations.swapaxes(-1, -2))

    @cached_property
    def own(self) -> Array:
        """(..., S, 2) each seat's own paddle, m."""
        return self._diagonal(self.turn(self.state.paddle))

    @cached_property
    def own_velocity(self) -> Array:
        """(..., S, 2) m/s."""
        return self._diagonal(self.turn(self.state.paddle_velocity))

    @cached_property
    def puck(self) -> Array:
        """(..., S, pucks, 2) m."""
        return self.turn(self.state.puck)

    @cached_property
    def puck_velocity(self) -> Array:
        """(..., S, pucks, 2) m/s."""
        return self.turn(self.state.puck_velocity)

    @staticmethod
    def _diagonal(vectors: Array) -> Array:
        if vectors.shape[-2] == 1:
            return vectors[..., 0, :]
        seats = np.arange(vectors.shape[-2])
        return np.asarray(vectors[..., seats, seats, :])


class Piece(ABC):
    """A part of an observation."""

    goal: bool = False
    """True for the wanted goal, which goals="dict" shows apart."""

    @abstractmethod
    def columns(self, scope: Scope) -> list[Column]:
        """One column for each number."""

    @abstractmethod
    def read(self, ego: Ego) -> Array:
        """(..., S, columns) the numbers."""


@dataclass(frozen=True)
class Own(Piece):
    """The seat's own paddle: position and velocity, as its robot reports them."""

    def columns(self, scope: Scope) -> list[Column]:
        centre = float(np.mean([x for x, _ in scope.cast.seats[0].reach]))
        return scope.place("own", (0.2, 0.2), centre) + scope.motion(
            "own", scope.top_speed, scope.top_speed
        )

    def read(self, ego: Ego) -> Array:
        return np.concatenate([ego.own, ego.own_velocity], -1)


@dataclass(frozen=True)
class Others(Piece):
    """The other paddles, mates first, each group by ego angle of its seat's side."""

    def columns(self, scope: Scope) -> list[Column]:
        columns = []
        for i in range(len(scope.cast.seats) - 1):
            columns += scope.place(f"other_{i}", (0.5, 0.2))
            columns += scope.motion(f"other_{i}", scope.top_speed, scope.top_speed)
        return columns

    def read(self, ego: Ego) -> Array:
        order = _others(ego.scope.cast)
        rows = np.arange(len(order))[:, None]
        place = ego.turn(ego.state.paddle)[..., rows, order, :]
        motion = ego.turn(ego.state.paddle_velocity)[..., rows, order, :]
        both = np.concatenate([place, motion], -1)
        return both.reshape(*both.shape[:-2], -1)


def _others(cast: Cast) -> Array:
    """(S, S - 1) indices of the other seats: mates, then opponents, by ego angle."""
    angles = np.arctan2(*cast.table.normals.T[::-1])
    rows = []
    for me, seat in enumerate(cast.seats):
        key = {
            k: (
                other.team != seat.team,
                float((angles[other.side] - angles[seat.side]) % (2 * np.pi)),
                k,
            )
            for k, other in enumerate(cast.seats)
            if k != me
        }
        rows.append(sorted(key, key=key.__getitem__))
    return np.array(rows, dtype=np.int64).reshape(len(cast.seats), -1)


@dataclass(frozen=True)
class Pucks(Piece):
    """Every puck: position and velocity, or its sensed history."""

    def columns(self, scope: Scope) -> list[Column]:
        columns: list[Column] = []
        for i in range(scope.cast.pucks):
            if scope.observe == "velocity":
                columns += scope.place(f"puck_{i}", (0.67, 0.25))
                columns += scope.motion(f"puck_{i}", PUCK_SPEED_CAP, 1.4)
            else:
                for ago in range(HISTORY - 1, -1, -1):
                    columns += scope.place(f"puck_{i}[-{ago}]", (0.67, 0.25))
                    columns.append(Column(f"puck_{i}[-{ago}].seen", 0.0, 1.0, 1.0))
        return columns

    def read(self, ego: Ego) -> Array:
        if ego.scope.observe == "velocity":
            both = np.concatenate([ego.puck, ego.puck_velocity], -1)
            return both.reshape(*both.shape[:-2], -1)
        lead = ego.history.shape[:-3]
        flat = ego.history.swapaxes(-2, -3).reshape(*lead, -1, 3)
        place = ego.turn(flat[..., :2])
        seen = np.broadcast_to(flat[..., None, :, 2:], (*place.shape[:-1], 1))
        both = np.concatenate([place, seen], -1)
        return both.reshape(*both.shape[:-2], -1)


@dataclass(frozen=True)
class PucksFromOwn(Piece):
    """The way from the seat's own paddle to every puck."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"own_to_puck_{i}" for i in range(scope.cast.pucks)]
        return [c for name in names for c in scope.gap(name, (0.25, 0.125))]

    def read(self, ego: Ego) -> Array:
        gap = ego.puck - ego.own[..., None, :]
        return gap.reshape(*gap.shape[:-2], -1)


@dataclass(frozen=True)
class Blocks(Piece):
    """Where every block is now."""

    x: float
    """Where blocks are to be expected, m."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"block_{i}" for i in range(scope.cast.blocks)]
        return [c for name in names for c in scope.place(name, (0.3, 0.2), self.x)]

    def read(self, ego: Ego) -> Array:
        place = ego.turn(ego.state.block)
        return place.reshape(*place.shape[:-2], -1)


@dataclass(frozen=True)
class BlocksFromPuck(Piece):
    """The way from puck 0 to every block."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"puck_0_to_block_{i}" for i in range(scope.cast.blocks)]
        return [c for name in names for c in scope.gap(name, (1.0, 0.5))]

    def read(self, ego: Ego) -> Array:
        gap = ego.turn(ego.state.block) - ego.puck[..., :1, :]
        return gap.reshape(*gap.shape[:-2], -1)


@dataclass(frozen=True)
class Touched(Piece):
    """1 once any paddle has touched any puck."""

    def columns(self, scope: Scope) -> list[Column]:
        return [Column("touched", 0.0, 1.0, 1.0)]

    def read(self, ego: Ego) -> Array:
        flag = touched(ego.memory)[..., None]
        seats = len(ego.scope.cast.seats)
        return np.broadcast_to(flag, (*flag.shape[:-1], seats))[..., None]


@dataclass(frozen=True)
class Goal(Piece):
    """A wanted place, and its way from the own paddle or from puck 0.

    ``memory["goal"]`` is (..., 2) in the table frame.
    """

    unit: tuple[float, float]
    x: float
    origin: str
    """"own" or "puck": what the goal is for."""
    goal = True

    def columns(self, scope: Scope) -> list[Column]:
        return scope.place("goal", self.unit, self.x) + scope.gap(
            f"{self.origin}_to_goal", self.unit
        )

    def read(self, ego: Ego) -> Array:
        goal = ego.turn(ego.memory["goal"][..., None, :])[..., 0, :]
        origin = ego.own if self.origin == "own" else ego.puck[..., 0, :]
        return np.concatenate([goal, goal - origin], -1)


@dataclass(frozen=True)
class GoalVelocity(Piece):
    """A wanted velocity, ``memory["goal_velocity"]`` (..., 2) in the table frame."""

    most: float
    unit: float
    goal = True

    def columns(self, scope: Scope) -> list[Column]:
        return scope.motion("goal", self.most, self.unit)

    def read(self, ego: Ego) -> Array:
        return ego.turn(ego.memory["goal_velocity"][..., None, :])[..., 0, :]


@dataclass(frozen=True)
class Recall(Piece):
    """Numbers of the memory, one a puck, that are no vectors: flags and heights."""

    name: str
    low: float
    high: float
    unit: float
    from_own: bool = False
    """True to show a height as seen from the own paddle."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"{self.name}_{i}" for i in range(scope.cast.pucks)]
        return [Column(name, self.low, self.high, self.unit) for name in names]

    def read(self, ego: Ego) -> Array:
        value = ego.memory[self.name][..., None, :]
        if self.from_own:
            return np.asarray(value - ego.own[..., :1])
        seats = len(ego.scope.cast.seats)
        return np.broadcast_to(value, (*value.shape[:-2], seats, value.shape[-1]))


class Layout:
    """The pieces of an observation side by side: bounds, labels, and how to read it."""

    def __init__(self, pieces: tuple[Piece, ...], scope: Scope) -> None:
        if scope.observe not in OBSERVE:
            raise ValueError(unknown("observe", scope.observe, OBSERVE))
        self.scope = scope
        columns = [piece.columns(scope) for piece in pieces]
        ends = np.cumsum([len(c) for c in columns]).tolist()
        starts = [0, *ends[:-1]]
        self._parts = [
            (piece, slice(a, b))
            for piece, a, b in zip(pieces, starts, ends, strict=True)
        ]
        flat = [column for part in columns for column in part]
        self.labels = tuple(column.label for column in flat)
        self.low = np.array([c.low for c in flat], np.float32)
        self.high = np.array([c.high for c in flat], np.float32)
        self.unit = np.array([c.unit for c in flat], np.float32)
        self.centre = np.array([c.centre for c in flat], np.float32)

    def read(self, ego: Ego) -> Array:
        """(..., S, columns) float32, inside the bounds."""
        seats = len(self.scope.cast.seats)
        shape = (*ego.state.time.shape, seats, len(self.labels))
        out = np.empty(shape, np.float32)
        for piece, part in self._parts:
            out[..., part] = piece.read(ego)
        np.maximum(out, self.low, out=out)
        return np.minimum(out, self.high, out=out)
