"""Observables: parts of an observation, with bounds and labels.

Vectors are in the seat's ego frame, in SI units.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.extrapolation import Walls, extrapolate
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory

OBSERVE = ("velocity", "estimate", "history", "pixels", "camera")
"""Observation types of pucks.

``velocity``: the sensed position and velocity. ``estimate``: position and velocity for
now, estimated by a filter with a model of the table. ``history``: the last sensed
positions, each with a visibility flag and the age of its frame, as from a camera.
``pixels``: drawn images of the table. Settings may follow, as in
``pixels:size=64,colour=rgb,frames=1``, see `image_form.ImageForm`. ``camera``: frames
of a camera, with the state of the own paddle, see `image_form.CameraForm`."""


HISTORY = 5
"""Number of sensed positions of a puck in a history."""
PENDING = 2
"""Number of last actions in an observation, which may not have taken effect yet."""


class Element(NamedTuple):
    """Element of an observation.

    ``(value - centre) / unit`` is of order one. Networks use it as a fixed scaling.
    """

    label: str
    low: float
    high: float
    unit: float
    centre: float = 0.0


@dataclass(frozen=True)
class ObservationContext:
    """Context from which observables determine their columns."""

    scene: Scene
    observe: str
    top_speed: float
    reaction: float = 0.0
    """Latency of pucks and other paddles by the rules of the game, s."""

    @property
    def extrapolates(self) -> bool:
        """True if delayed pucks are observed together with a prediction for now."""
        return self.reaction > 0.0 and self.observe != "history"

    @cached_property
    def extent(self) -> Array:
        """Largest |x| and |y| of the table in any seat's ego frame (2,), m."""
        corners = np.asarray(self.scene.table.vertices)
        rotated = [products(corners, r) for r in self.rotations]
        return np.asarray(np.max(np.abs(rotated), axis=(0, 1)))

    @cached_property
    def walls(self) -> Walls:
        """Walls for the prediction of pucks, table frame."""
        return Walls.of(self.scene)

    @cached_property
    def rotations(self) -> Array:
        """Rotations from the table frame to each seat's ego frame (S, 2, 2)."""
        return np.array([self.scene.table.rotation(s.side) for s in self.scene.seats])

    @cached_property
    def straight(self) -> bool:
        """True if there is one seat and its ego frame is the table frame."""
        return len(self.rotations) == 1 and bool(self.rotations[0, 0, 0] == 1.0)

    def position_columns(
        self, name: str, unit: tuple[float, float], x: float = 0.0
    ) -> list[Element]:
        """Return the columns of a position, centred at (x, 0)."""
        ex, ey = self.extent
        return [
            Element(f"{name}.x", -ex, ex, unit[0], x),
            Element(f"{name}.y", -ey, ey, unit[1]),
        ]

    def offset_columns(self, name: str, unit: tuple[float, float]) -> list[Element]:
        """Return the columns of the offset from one position to another."""
        ex, ey = 2 * self.extent
        return [
            Element(f"{name}.dx", -ex, ex, unit[0]),
            Element(f"{name}.dy", -ey, ey, unit[1]),
        ]

    def velocity_columns(self, name: str, most: float, unit: float) -> list[Element]:
        """Return the columns of a velocity."""
        return [Element(f"{name}.v{axis}", -most, most, unit) for axis in "xy"]


class EgoView:
    """Sensed state as seen from every seat, and the seat's own paddle.

    With a reaction time, state, memory and history are from a time in the past.
    """

    def __init__(
        self,
        state: State,
        memory: Memory,
        history: Array,
        requested: Array,
        paddle: tuple[Array, Array],
        scope: ObservationContext,
    ) -> None:
        self.state, self.memory, self.scope = state, memory, scope
        self.history = history
        """Sensed x and y, m, visibility, and age, s, of the pucks
        (..., HISTORY, pucks, 4), table frame, newest last."""
        self.requested = requested
        """Requested actions (..., PENDING, S, 2), ego frames, newest last."""
        self.own, self.own_velocity = (self._own(x) for x in paddle)
        """Position and velocity of each own paddle now (..., S, 2), m and m/s."""
        self.puck = self.rotate(state.puck)
        """Positions of the pucks (..., S, pucks, 2), m."""
        self.puck_velocity = self.rotate(state.puck_velocity)
        """Velocities of the pucks (..., S, pucks, 2), m/s."""
        self.puck_edge = state.puck_edge[..., None, :]
        """Speeds of the pucks' edges (..., 1, pucks), the same for all seats, m/s."""

    def kept(self, name: str) -> Array:
        """Return an array of the scenario's memory.

        Raises:
            ValueError: The memory contains no array with this name.
        """
        if name not in self.memory:
            raise ValueError(unknown_name("memory", name, self.memory))
        return self.memory[name]

    def rotate(self, vectors: Array) -> Array:
        """Rotate vectors (..., n, 2) from the table to ego frames (..., S, n, 2)."""
        seats = vectors[..., None, :, :]
        if self.scope.straight:
            return seats
        return products(seats, self.scope.rotations[:, None])

    @property
    def puck_predicted(self) -> tuple[Array, Array]:
        """Positions and velocities of the pucks now (..., S, pucks, 2), m and m/s.

        They are extrapolated over the reaction time, if there is one, see
        `extrapolation.extrapolate`. The movements of paddles in this time are unknown.
        """
        if not self.scope.extrapolates:
            return self.puck, self.puck_velocity
        seen = self.state.puck, self.state.puck_velocity
        now = extrapolate(*seen, self.scope.reaction, self.scope.walls)
        return self.rotate(now[0]), self.rotate(now[1])

    @property
    def own_delayed(self) -> tuple[Array, Array]:
        """Own paddles at the time of the sensed state (..., S, 2), m and m/s."""
        state = self.state
        return self._own(state.paddle), self._own(state.paddle_velocity)

    def _own(self, vectors: Array) -> Array:
        if self.scope.straight:
            return vectors
        seats = np.arange(vectors.shape[-2])
        own: Array = self.rotate(vectors)[..., seats, seats, :]
        return own


class Observable(ABC):
    """Part of an observation."""

    goal: bool = False
    """True for the desired goal, which is a separate entry with goals="dict"."""

    @abstractmethod
    def columns(self, scope: ObservationContext) -> list[Element]:
        """Return a column for each number."""

    @abstractmethod
    def write(self, ego: EgoView, out: Array) -> None:
        """Write the numbers to ``out`` (..., S, columns)."""


class ObservationLayout:
    """Concatenated observables: bounds, labels, and the numbers of an ego view."""

    def __init__(
        self, observables: tuple[Observable, ...], scope: ObservationContext
    ) -> None:
        self.scope = scope
        columns = [observable.columns(scope) for observable in observables]
        ends = np.cumsum([len(c) for c in columns]).tolist()
        starts = [0, *ends[:-1]]
        self._parts = [
            (observable, slice(a, b))
            for observable, a, b in zip(observables, starts, ends, strict=True)
        ]
        flat = [column for part in columns for column in part]
        self.meanings = tuple(
            (type(observable).__doc__ or "").partition("\n\n")[0]
            for observable, part in zip(observables, columns, strict=True)
            for _ in part
        )
        """Meaning of each column: the first sentence of its observable's docstring."""
        self.labels = tuple(column.label for column in flat)
        self.low = np.array([c.low for c in flat], np.float32)
        self.high = np.array([c.high for c in flat], np.float32)
        self.unit = np.array([c.unit for c in flat], np.float32)
        self.centre = np.array([c.centre for c in flat], np.float32)

    def read(self, ego: EgoView) -> Array:
        """Return the numbers (..., S, columns), float32, clipped to the bounds."""
        seats = len(self.scope.scene.seats)
        shape = (*ego.state.time.shape, seats, len(self.labels))
        out = np.empty_like(ego.state.position, shape=shape)
        for observable, part in self._parts:
            observable.write(ego, out[..., part])
        inside = np.minimum(np.maximum(out, self.low), self.high)
        return inside.astype(np.float32)
