"""Control step: limits, physics and rules as one pipeline on arrays that stay."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.core.limits import INFINITE, Limited, limits_stage
from marl_airhockey.core.rows import clear_rows
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.core.servo import servo_stage
from marl_airhockey.core.state import State
from marl_airhockey.jit.pipeline import Pipeline, Stage
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.episode import Episode
from marl_airhockey.world.referee import Referee, Step, Verdict


class Moment(NamedTuple):
    """State of B worlds and of their episodes, and the step that led to it."""

    state: State
    ordered: Limited
    """What the limits passed, and by how much the actions exceeded them"""
    limited: Limited
    """What the paddles do: the same, or with a servo what follows it"""
    rate: Array
    """Acceleration of the servos (B, S, 2), m/s2"""
    verdict: Verdict
    episode: Episode
    """Counters, those of the verdict among them"""

    def write(self, worlds: Array, rows: State, memory: Memory) -> None:
        """Copy rows of a state and a memory into some worlds, by index."""
        self.state.write(worlds, rows)
        for name, row in memory.items():
            self.verdict.memory[name][worlds] = row

    def begin(self, worlds: Array) -> None:
        """Begin to count anew in some worlds, by index, from paddles at rest."""
        counts = (*self.episode.running, self.limited.acceleration)
        clear_rows(worlds, tuple(x.reshape(len(x), -1) for x in counts))
        self.ordered.velocity[worlds] = self.state.paddle_velocity[worlds]
        self.ordered.acceleration[worlds] = self.rate[worlds] = 0.0


class ControlStep:
    """Control step of B worlds, from actions to rewards.

    There are two moments, before and after, which change their parts at every step:
    what one holds is overwritten by the step after the next. The rules are compiled
    when it is built. Copies and pickles hold the arrays and compile nothing anew.

    Args:
        backend: moves the bodies.
        referee: applies the rules.
        reach: of the seats.
        limit: (B,) control steps after which the clock ends an episode.
        episode: of all worlds; its arrays are used.
        state: of all worlds, where they begin.
        memory: of all worlds, where they begin.
        lags: True if paddles follow their orders as a servo does.

    Raises:
        ValueError: a memory whose arrays change their type or shape in a step, named.
    """

    def __init__(
        self,
        backend: Backend,
        referee: Referee,
        reach: ReachPlanes,
        limit: Array,
        episode: Episode,
        state: State,
        memory: Memory,
        lags: bool = False,
    ) -> None:
        self._backend, self._referee, self._reach = backend, referee, reach
        self._limit, self._name = limit, referee.scenario.name
        self._lags = lags
        b, seats = len(limit), len(reach.share)
        self.action = np.zeros((b, seats, 2))
        """(B, seats, 2) actions after their delay: fractions of top speed, ego frames;
        to be filled, like the next three"""
        still = Command.still(backend.scene, b)
        self.prescribed, self.closed = still.prescribed, still.closed
        self.raised = still.raised
        self._late = np.zeros_like(self.action)
        """(B, seats, 2) what servos make of the orders, as actions"""
        self._moments = tuple(self._moment(state, memory, episode) for _ in range(2))
        self._now = 0
        self._pipelines: list[Pipeline] = []
        self._compile()

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_pipelines": []}

    @property
    def now(self) -> Moment:
        """Moment at which the worlds are."""
        return self._moments[self._now]

    def __call__(self) -> Moment:
        """Move all worlds by a step and return the moment after it.

        Raises:
            ValueError: an action that is not finite.
        """
        if not self._pipelines:
            self._compile()
        if not self._pipelines[self._now]():
            raise ValueError(INFINITE)
        self._now = 1 - self._now
        return self._moments[self._now]

    def _moment(self, state: State, memory: Memory, episode: Episode) -> Moment:
        """Return a moment with arrays of its own, as a step that goes nowhere fills."""
        here, b = self._backend.empty_state(), len(self._limit)
        here.write(np.arange(b), state)
        limited = Limited.empty(b, len(self._reach.share))
        ordered = Limited.empty(b, len(self._reach.share)) if self._lags else limited
        step = Step(here, limited.velocity, here, memory, episode, self._limit)
        verdict = self._referee.prepare(step)
        _check_memory(memory, verdict.memory)
        counted = episode.counted(verdict.counters)
        rate = np.zeros_like(limited.velocity)
        return Moment(here, ordered, limited, rate, verdict, counted)

    def _compile(self) -> None:
        first, second = self._moments
        pairs = (first, second), (second, first)
        self._pipelines = [self._pipeline(*pair) for pair in pairs]

    def _limits(self, before: Moment, after: Moment) -> list[Stage]:
        """Return the stages from actions to what the paddles are to do."""
        state, physics = before.state, before.episode.physics
        top, reach = physics["paddle_speed"], self._reach
        shared = reach, (top, physics["paddle_acceleration"]), self._backend.control_dt
        last = before.limited.velocity if self._backend.late else state.velocity
        moved = state.position, last, before.limited.acceleration
        if not self._lags:
            given = self.action, self.prescribed, moved
            return [limits_stage(*given, *shared, after.limited)]
        old, new = before.ordered, after.ordered
        ordered = state.position, old.velocity, old.acceleration
        servo = servo_stage(
            (old.velocity, new.velocity),
            state.velocity,
            (before.rate, after.rate),
            physics["servo_time"],
            top,
            reach,
            self._backend.control_dt,
            self._late,
        )
        # Twice, as what lags must stay within the reach as well.
        return [
            limits_stage(self.action, self.prescribed, ordered, *shared, new),
            servo,
            limits_stage(self._late, self.prescribed, moved, *shared, after.limited),
        ]

    def _pipeline(self, before: Moment, after: Moment) -> Pipeline:
        state, velocity = before.state, after.limited.velocity
        command = Command(velocity, self.prescribed, self.closed, self.raised)
        step = Step(
            *(state, velocity, after.state, before.verdict.memory),
            *(before.episode, self._limit),
        )
        stages = [
            *self._limits(before, after),
            self._backend.stage(command, state, after.state),
            self._referee.stage(step, after.verdict),
        ]
        return Pipeline(len(self._limit), stages, self._name)


def _check_memory(old: Memory, new: Memory) -> None:
    """Refuse a memory that is not of the same kind after a step."""
    for name in old.keys() | new.keys():
        kinds = [
            f"{m[name].dtype} {m[name].shape}" if name in m else "nothing"
            for m in (old, new)
        ]
        if kinds[0] != kinds[1]:
            raise ValueError(
                f"memory {name!r}: it begins as {kinds[0]} and is {kinds[1]} after a "
                "step; let `initial_memory` give what `update_memory` gives"
            )
