"""Observables: the parts of an observation that scenarios share.

A scenario lists observables. Spaces, labels and scales are derived from their columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.sim.contracts.observable import (
    HISTORY,
    PENDING,
    EgoView,
    Element,
    Observable,
    ObservationContext,
)
from marl_airhockey.sim.core.parameters import PUCK_SPEED_CAP
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.touches import touched
from marl_airhockey.types import Array


@dataclass(frozen=True)
class OwnPaddle(Observable):
    """Position and velocity of the own paddle; `delayed`: at the time of the rest.

    The robot of the seat reports them, in m and m/s. With an observation latency the
    delayed values follow: those at the time of all other observations. An estimate or a
    history also contains the last actions, which may not have taken effect yet.
    """

    def columns(self, scope: ObservationContext) -> list[Element]:
        centre = float(np.mean([x for x, _ in scope.scene.seats[0].reach]))
        columns = scope.position_columns("own", (0.2, 0.2), centre)
        columns += scope.velocity_columns("own", scope.top_speed, scope.top_speed)
        if scope.observe != "velocity":
            for ago in range(PENDING, 0, -1):
                names = (f"own.requested[-{ago}].{axis}" for axis in "xy")
                columns += [Element(name, -1.0, 1.0, 1.0) for name in names]
        if scope.reaction:
            columns += scope.position_columns("own.delayed", (0.2, 0.2), centre)
            columns += scope.velocity_columns(
                "own.delayed", scope.top_speed, scope.top_speed
            )
        return columns

    def write(self, ego: EgoView, out: Array) -> None:
        out[..., :2] = ego.own
        out[..., 2:4] = ego.own_velocity
        end = 4
        if ego.scope.observe != "velocity":
            actions, end = ego.requested.swapaxes(-2, -3), 4 + 2 * PENDING
            out[..., 4:end] = actions.reshape(*actions.shape[:-2], -1)
        if ego.scope.reaction:
            out[..., end : end + 2], out[..., end + 2 :] = ego.own_delayed


@dataclass(frozen=True)
class OtherPaddles(Observable):
    """Position and velocity of each other paddle, m and m/s, teammates first.

    Teammates and opponents are sorted by the angle of their side, ego frame.
    """

    def columns(self, scope: ObservationContext) -> list[Element]:
        columns = []
        for i in range(len(scope.scene.seats) - 1):
            columns += scope.position_columns(f"other_{i}", (0.5, 0.2))
            columns += scope.velocity_columns(
                f"other_{i}", scope.top_speed, scope.top_speed
            )
        return columns

    def write(self, ego: EgoView, out: Array) -> None:
        order = _others(ego.scope.scene)
        rows = np.arange(len(order))[:, None]
        place = ego.rotate(ego.state.paddle)[..., rows, order, :]
        motion = ego.rotate(ego.state.paddle_velocity)[..., rows, order, :]
        both = np.concatenate([place, motion], -1)
        out[...] = both.reshape(out.shape)


def _others(scene: Scene) -> Array:
    """Return the indices (S, S - 1) of the other seats, teammates first."""
    sides, rows = len(scene.table.vertices), []
    for me, seat in enumerate(scene.seats):
        key = {
            k: (
                other.team != seat.team,
                (other.side - seat.side) % sides,
                k,
            )
            for k, other in enumerate(scene.seats)
            if k != me
        }
        rows.append(sorted(key, key=key.__getitem__))
    return np.array(rows, dtype=np.int64).reshape(len(scene.seats), -1)


@dataclass(frozen=True)
class Pucks(Observable):
    """Position, velocity and spin of each puck; `predicted`: extrapolated to now.

    The spin is the speed of the edge, radius times angular velocity, counter-clockwise.
    With a reaction time, position and velocity for now follow, see
    `extrapolation.extrapolate`. An estimate also contains visibility and age, s, of the
    newest frame. A history contains position, visibility and age of several frames.
    """

    def columns(self, scope: ObservationContext) -> list[Element]:
        columns: list[Element] = []
        for i in range(scope.scene.pucks):
            if scope.observe == "history":
                for ago in range(HISTORY - 1, -1, -1):
                    columns += scope.position_columns(f"puck_{i}[-{ago}]", (0.67, 0.25))
                    columns += _frame_columns(f"puck_{i}[-{ago}]")
                continue
            columns += scope.position_columns(f"puck_{i}", (0.67, 0.25))
            columns += scope.velocity_columns(f"puck_{i}", PUCK_SPEED_CAP, 1.4)
            most = PUCK_SPEED_CAP
            columns.append(Element(f"puck_{i}.spin", -most, most, 0.5))
            if scope.extrapolates:
                columns += scope.position_columns(f"puck_{i}.predicted", (0.67, 0.25))
                columns += scope.velocity_columns(f"puck_{i}.predicted", most, 1.4)
            if scope.observe == "estimate":
                columns += _frame_columns(f"puck_{i}")
        return columns

    def write(self, ego: EgoView, out: Array) -> None:
        if ego.scope.observe != "history":
            pucks = ego.scope.scene.pucks
            size, (place, motion) = out.shape[-1] // pucks, ego.puck_predicted
            for i in range(pucks):
                part = out[..., size * i : size * (i + 1)]
                part[..., :2] = ego.puck[..., i, :]
                part[..., 2:4] = ego.puck_velocity[..., i, :]
                part[..., 4] = ego.puck_edge[..., i]
                if ego.scope.extrapolates:
                    part[..., 5:7] = place[..., i, :]
                    part[..., 7:9] = motion[..., i, :]
                if ego.scope.observe == "estimate":
                    part[..., -2:] = ego.history[..., None, -1, i, 2:]
            return
        lead = ego.history.shape[:-3]
        flat = ego.history.swapaxes(-2, -3).reshape(*lead, -1, 4)
        place = ego.rotate(flat[..., :2])
        seen = np.broadcast_to(flat[..., None, :, 2:], place.shape)
        both = np.concatenate([place, seen], -1)
        out[...] = both.reshape(out.shape)


def _frame_columns(name: str) -> list[Element]:
    """Return the columns of the visibility and the age of a frame."""
    return [
        Element(f"{name}.seen", 0.0, 1.0, 1.0),
        Element(f"{name}.age", 0.0, 1.0, 0.1),
    ]


@dataclass(frozen=True)
class OwnToPucks(Observable):
    """Vector from the own paddle to each puck, m.

    With a reaction time it is computed from the predicted position of the puck.
    """

    def columns(self, scope: ObservationContext) -> list[Element]:
        names = [f"own_to_puck_{i}" for i in range(scope.scene.pucks)]
        return [c for name in names for c in scope.offset_columns(name, (0.25, 0.125))]

    def write(self, ego: EgoView, out: Array) -> None:
        out[...] = (ego.puck_predicted[0] - ego.own[..., None, :]).reshape(out.shape)


@dataclass(frozen=True)
class Blocks(Observable):
    """Position of each block, m."""

    x: float
    """Typical x of blocks, m, which is the centre of the scaling."""

    def columns(self, scope: ObservationContext) -> list[Element]:
        names = [f"block_{i}" for i in range(scope.scene.blocks)]
        return [
            c
            for name in names
            for c in scope.position_columns(name, (0.3, 0.2), self.x)
        ]

    def write(self, ego: EgoView, out: Array) -> None:
        out[...] = ego.rotate(ego.state.block).reshape(out.shape)


@dataclass(frozen=True)
class PuckToBlocks(Observable):
    """Vector from puck 0 to each block, m."""

    def columns(self, scope: ObservationContext) -> list[Element]:
        names = [f"puck_0_to_block_{i}" for i in range(scope.scene.blocks)]
        return [c for name in names for c in scope.offset_columns(name, (1.0, 0.5))]

    def write(self, ego: EgoView, out: Array) -> None:
        gap = ego.rotate(ego.state.block) - ego.puck[..., :1, :]
        out[...] = gap.reshape(out.shape)


@dataclass(frozen=True)
class Touched(Observable):
    """Flag that is 1 after any paddle has touched any puck, else 0."""

    def columns(self, scope: ObservationContext) -> list[Element]:
        return [Element("touched", 0.0, 1.0, 1.0)]

    def write(self, ego: EgoView, out: Array) -> None:
        out[...] = touched(ego.memory)[..., None, None]


@dataclass(frozen=True)
class Goal(Observable):
    """Position of the goal, and vector to it from the own paddle or puck 0, m.

    The memory contains the goal (..., 2), table frame, m.
    """

    unit: tuple[float, float]
    x: float
    origin: str
    """Body from which the vector starts: "own" or "puck"."""
    name: str = "goal"
    """Name of the goal in the memory."""
    goal = True

    def columns(self, scope: ObservationContext) -> list[Element]:
        position = scope.position_columns(self.name, self.unit, self.x)
        offset = scope.offset_columns(f"{self.origin}_to_{self.name}", self.unit)
        return position + offset

    def write(self, ego: EgoView, out: Array) -> None:
        goal = ego.rotate(ego.kept(self.name)[..., None, :])[..., 0, :]
        out[..., :2] = goal
        out[..., 2:] = goal - (ego.own if self.origin == "own" else ego.puck[..., 0, :])


@dataclass(frozen=True)
class GoalVelocity(Observable):
    """Target velocity at the goal, m/s.

    The memory contains ``goal_velocity`` (..., 2), table frame, m/s.
    """

    most: float
    unit: float
    goal = True

    def columns(self, scope: ObservationContext) -> list[Element]:
        return scope.velocity_columns("goal", self.most, self.unit)

    def write(self, ego: EgoView, out: Array) -> None:
        out[...] = ego.rotate(ego.kept("goal_velocity")[..., None, :])[..., 0, :]


@dataclass(frozen=True)
class PossessionTime(Observable):
    """Time for which each puck has been within reach of the own team, s.

    `rewards.held` computes it.
    """

    most: float

    def columns(self, scope: ObservationContext) -> list[Element]:
        names = [f"held_{i}" for i in range(scope.scene.pucks)]
        return [Element(name, 0.0, self.most, 0.4 * self.most) for name in names]

    def write(self, ego: EgoView, out: Array) -> None:
        out[...] = ego.kept("held")


@dataclass(frozen=True)
class PerSeat(Observable):
    """Number of each seat, such as its lives, in the order of the paddles.

    The memory contains ``name`` (..., seats). The own seat is the first one. The others
    follow as in `OtherPaddles`.
    """

    name: str
    most: float

    def columns(self, scope: ObservationContext) -> list[Element]:
        others = [f"other_{i}" for i in range(len(scope.scene.seats) - 1)]
        names = [f"{who}.{self.name}" for who in ("own", *others)]
        return [Element(name, 0.0, self.most, self.most) for name in names]

    def write(self, ego: EgoView, out: Array) -> None:
        value = ego.kept(self.name)
        out[..., 0] = value
        out[..., 1:] = value[..., _others(ego.scope.scene)]


@dataclass(frozen=True)
class IsThisSeat(Observable):
    """Seat that the label names: 1 for the own seat, -1 for another, 0 for none.

    The memory contains its number from 1, (...) or per puck (..., pucks), see
    `rewards.last_toucher`.
    """

    name: str

    def columns(self, scope: ObservationContext) -> list[Element]:
        names = [f"{self.name}_{i}" for i in range(scope.scene.pucks)]
        return [Element(name, -1.0, 1.0, 1.0) for name in names]

    def write(self, ego: EgoView, out: Array) -> None:
        who = ego.kept(self.name)
        rows = who.reshape(*ego.state.time.shape, 1, -1)
        own = 1.0 + np.arange(len(ego.scope.scene.seats))[:, None]
        out[...] = np.where(rows == 0.0, 0.0, np.where(rows == own, 1.0, -1.0))


@dataclass(frozen=True)
class FromMemory(Observable):
    """Quantity of the rules for each puck: a flag, a count, or a height, m."""

    name: str
    low: float
    high: float
    unit: float
    from_own: bool = False
    """True for a height relative to the own paddle."""

    def columns(self, scope: ObservationContext) -> list[Element]:
        names = [f"{self.name}_{i}" for i in range(scope.scene.pucks)]
        return [Element(name, self.low, self.high, self.unit) for name in names]

    def write(self, ego: EgoView, out: Array) -> None:
        kept, pucks = ego.kept(self.name), out.shape[-1]
        if kept.ndim != out.ndim - 1 or kept.shape[-1] != pucks:
            raise ValueError(
                f"memory {self.name!r}: FromMemory needs a number for each puck, "
                f"(..., {pucks}); got shape {kept.shape}"
            )
        value = kept[..., None, :]
        out[...] = value - ego.own[..., :1] if self.from_own else value
