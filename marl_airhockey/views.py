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

    @cached_property
    def straight(self) -> bool:
        """True if there is one seat and its ego frame is the table frame."""
        return len(self.rotations) == 1 and bool(self.rotations[0, 0, 0] == 1.0)

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
        self.state, self.memory, self.scope = state, memory, scope
        self.history = history
        """(..., HISTORY, pucks, 3) sensed positions and visibility, newest last"""
        self.own = self._own(state.paddle)
        """(..., S, 2) each seat's own paddle, m"""
        self.own_velocity = self._own(state.paddle_velocity)
        """(..., S, 2) m/s"""
        self.puck = self.turn(state.puck)
        """(..., S, pucks, 2) m"""
        self.puck_velocity = self.turn(state.puck_velocity)
        """(..., S, pucks, 2) m/s"""

    def turn(self, vectors: Array) -> Array:
        """(..., n, 2) vectors of the table frame to (..., S, n, 2) in ego frames."""
        seats = vectors[..., None, :, :]
        if self.scope.straight:
            return seats
        return np.asarray(seats @ self.scope.rotations.swapaxes(-1, -2))

    def _own(self, vectors: Array) -> Array:
        if self.scope.straight:
            return vectors
        seats = np.arange(vectors.shape[-2])
        return np.asarray(self.turn(vectors)[..., seats, seats, :])


class Piece(ABC):
    """A part of an observation."""

    goal: bool = False
    """True for the wanted goal, which goals="dict" shows apart."""

    @abstractmethod
    def columns(self, scope: Scope) -> list[Column]:
        """One column for each number."""

    @abstractmethod
    def write(self, ego: Ego, out: Array) -> None:
        """Put the numbers into ``out`` (..., S, columns)."""


@dataclass(frozen=True)
class Own(Piece):
    """The seat's own paddle: position and velocity, as its robot reports them."""

    def columns(self, scope: Scope) -> list[Column]:
        centre = float(np.mean([x for x, _ in scope.cast.seats[0].reach]))
        return scope.place("own", (0.2, 0.2), centre) + scope.motion(
            "own", scope.top_speed, scope.top_speed
        )

    def write(self, ego: Ego, out: Array) -> None:
        out[..., :2] = ego.own
        out[..., 2:] = ego.own_velocity


@dataclass(frozen=True)
class Others(Piece):
    """The other paddles, mates first, each group by ego angle of its seat's side."""

    def columns(self, scope: Scope) -> list[Column]:
        columns = []
        for i in range(len(scope.cast.seats) - 1):
            columns += scope.place(f"other_{i}", (0.5, 0.2))
            columns += scope.motion(f"other_{i}", scope.top_speed, scope.top_speed)
        return columns

    def write(self, ego: Ego, out: Array) -> None:
        order = _others(ego.scope.cast)
        rows = np.arange(len(order))[:, None]
        place = ego.turn(ego.state.paddle)[..., rows, order, :]
        motion = ego.turn(ego.state.paddle_velocity)[..., rows, order, :]
        both = np.concatenate([place, motion], -1)
        out[...] = both.reshape(out.shape)


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

    def write(self, ego: Ego, out: Array) -> None:
        if ego.scope.observe == "velocity":
            for i in range(ego.scope.cast.pucks):
                out[..., 4 * i : 4 * i + 2] = ego.puck[..., i, :]
                out[..., 4 * i + 2 : 4 * i + 4] = ego.puck_velocity[..., i, :]
            return
        lead = ego.history.shape[:-3]
        flat = ego.history.swapaxes(-2, -3).reshape(*lead, -1, 3)
        place = ego.turn(flat[..., :2])
        seen = np.broadcast_to(flat[..., None, :, 2:], (*place.shape[:-1], 1))
        both = np.concatenate([place, seen], -1)
        out[...] = both.reshape(out.shape)


@dataclass(frozen=True)
class PucksFromOwn(Piece):
    """The way from the seat's own paddle to every puck."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"own_to_puck_{i}" for i in range(scope.cast.pucks)]
        return [c for name in names for c in scope.gap(name, (0.25, 0.125))]

    def write(self, ego: Ego, out: Array) -> None:
        out[...] = (ego.puck - ego.own[..., None, :]).reshape(out.shape)


@dataclass(frozen=True)
class Blocks(Piece):
    """Where every block is now."""

    x: float
    """Where blocks are to be expected, m."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"block_{i}" for i in range(scope.cast.blocks)]
        return [c for name in names for c in scope.place(name, (0.3, 0.2), self.x)]

    def write(self, ego: Ego, out: Array) -> None:
        out[...] = ego.turn(ego.state.block).reshape(out.shape)


@dataclass(frozen=True)
class BlocksFromPuck(Piece):
    """The way from puck 0 to every block."""

    def columns(self, scope: Scope) -> list[Column]:
        names = [f"puck_0_to_block_{i}" for i in range(scope.cast.blocks)]
        return [c for name in names for c in scope.gap(name, (1.0, 0.5))]

    def write(self, ego: Ego, out: Array) -> None:
        gap = ego.turn(ego.state.block) - ego.puck[..., :1, :]
        out[...] = gap.reshape(out.shape)


@dataclass(frozen=True)
class Touched(Piece):
    """1 once any paddle has touched any puck."""

    def columns(self, scope: Scope) -> list[Column]:
        return [Column("touched", 0.0, 1.0, 1.0)]

    def write(self, ego: Ego, out: Array) -> None:
        out[...] = touched(ego.memory)[..., None, None]


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

    def write(self, ego: Ego, out: Array) -> None:
        goal = ego.turn(ego.memory["goal"][..., None, :])[..., 0, :]
        out[..., :2] = goal
        out[..., 2:] = goal - (ego.own if self.origin == "own" else ego.puck[..., 0, :])


@dataclass(frozen=True)
class GoalVelocity(Piece):
    """A wanted velocity, ``memory["goal_velocity"]`` (..., 2) in the table frame."""

    most: float
    unit: float
    goal = True

    def columns(self, scope: Scope) -> list[Column]:
        return scope.motion("goal", self.most, self.unit)

    def write(self, ego: Ego, out: Array) -> None:
        out[...] = ego.turn(ego.memory["goal_velocity"][..., None, :])[..., 0, :]


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

    def write(self, ego: Ego, out: Array) -> None:
        value = ego.memory[self.name][..., None, :]
        out[...] = value - ego.own[..., :1] if self.from_own else value


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
            piece.write(ego, out[..., part])
        np.maximum(out, self.low, out=out)
        return np.minimum(out, self.high, out=out)
