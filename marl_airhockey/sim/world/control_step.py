"""Control step: limits, servo, physics, rules and observation as one pipeline.

All stages work on preallocated arrays, which are overwritten in place.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.backend import Backend, Command, LiveBackend
from marl_airhockey.sim.core.limits import INFINITE, Limited, limits_stage
from marl_airhockey.sim.core.rows import clear_rows
from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.core.servo import servo_stage
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Sink
from marl_airhockey.sim.jit.pipeline import Pipeline, Stage
from marl_airhockey.sim.world.actions import Inputs
from marl_airhockey.sim.world.episode import EpisodeCounters
from marl_airhockey.sim.world.observer import Observer
from marl_airhockey.sim.world.referee import Referee, Step, Verdict
from marl_airhockey.types import Array, Memory


class Moment(NamedTuple):
    """State of B worlds and of their episodes, and the step that led to it."""

    state: State
    commanded: Limited
    """Commands after the limits, and the excess of the actions over the limits."""
    realized: Limited
    """Commands that the paddles follow: ``commanded``, or the response of a servo."""
    rate: Array
    """Acceleration of the servos (B, S, 2), table frame, m/s2."""
    verdict: Verdict
    episode: EpisodeCounters
    """Counters of the episodes, including the counters of the verdict."""
    shown: Sink
    """Observations of all seats from the true state, see `Observer.stage`."""

    def write(self, worlds: Array, rows: State, memory: Memory) -> None:
        """Copy rows of a state and a memory into some worlds, by index (W,)."""
        self.state.write(worlds, rows)
        for name, row in memory.items():
            self.verdict.memory[name][worlds] = row

    def begin(self, worlds: Array) -> None:
        """Reset counters and accelerations of some worlds, by index (W,)."""
        counts = (*self.episode.running, self.realized.acceleration)
        clear_rows(worlds, tuple(x.reshape(len(x), -1) for x in counts))
        self.commanded.velocity[worlds] = self.state.paddle_velocity[worlds]
        self.commanded.acceleration[worlds] = self.rate[worlds] = 0.0


class ControlStep:
    """Control step of B worlds, from actions to rewards.

    Two moments, before and after the step, swap their roles in every step. The step
    after the next overwrites the arrays of a moment. The constructor compiles rules and
    observations. Copies and pickles contain the arrays and compile nothing again.

    Args:
        inputs: Inputs of every step, used by reference.
        backend: Backend of the worlds.
        referee: Referee, which applies the rules.
        observer: Observer, which computes the observations.
        reach: Workspaces of the seats.
        limit: Number of control steps after which an episode is truncated (B,).
        episode: Counters of all worlds, used by reference.
        state: Initial state of all worlds.
        memory: Initial memory of all worlds.
        lags: True if paddles follow their commands with the lag of a servo.

    Raises:
        ValueError: An array of the memory changes its type or shape in a step.
    """

    def __init__(
        self,
        inputs: Inputs,
        backend: Backend,
        referee: Referee,
        observer: Observer,
        reach: ReachPlanes,
        limit: Array,
        episode: EpisodeCounters,
        state: State,
        memory: Memory,
        lags: bool = False,
    ) -> None:
        self.inputs, self._backend, self._referee = inputs, backend, referee
        self._observer, self._reach, self._limit = observer, reach, limit
        self._name, self._lags = referee.scenario.name, lags
        self._response = np.zeros_like(inputs.action)
        """Responses of the servos to the commands, as actions (B, seats, 2)."""
        self.moments = tuple(self._moment(state, memory, episode) for _ in range(2))
        self.current = 0
        """Index of the current moment."""
        self.pipelines: list[Pipeline] = []
        """Pipelines from the first moment to the second, and back."""
        self._compile()

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "pipelines": []}

    @property
    def now(self) -> Moment:
        """Current moment of the worlds."""
        return self.moments[self.current]

    def __call__(self) -> Moment:
        """Move all worlds by a step and return the moment after it.

        Raises:
            ValueError: An action is not finite.
        """
        if not self.pipelines:
            self._compile()
        if not self.pipelines[self.current]():
            raise ValueError(INFINITE)
        self.current = 1 - self.current
        return self.moments[self.current]

    def _moment(self, state: State, memory: Memory, episode: EpisodeCounters) -> Moment:
        """Return a moment with new arrays, filled as by a step of zero length."""
        here, b = self._backend.empty_state(), len(self._limit)
        here.write(np.arange(b), state)
        realized = Limited.empty(b, len(self._reach.share))
        commanded = realized
        if self._lags:
            commanded = Limited.empty(b, len(self._reach.share))
        step = Step(here, realized.velocity, here, memory, episode, self._limit)
        verdict = self._referee.prepare(step)
        _check_memory(memory, verdict.memory)
        counted = episode.counted(verdict.counters)
        rate = np.zeros_like(realized.velocity)
        shown = self._observer.prepare(here, verdict.memory)
        return Moment(here, commanded, realized, rate, verdict, counted, shown)

    def _compile(self) -> None:
        first, second = self.moments
        pairs = (first, second), (second, first)
        self.pipelines = [self._pipeline(*pair) for pair in pairs]

    def _limits(self, before: Moment, after: Moment) -> list[Stage]:
        """Return the stages from actions to the commands that paddles follow."""
        state, physics = before.state, before.episode.physics
        action, prescribed = self.inputs.action, self.inputs.prescribed
        top, reach = physics["paddle_speed"], self._reach
        shared = reach, (top, physics["paddle_acceleration"]), self._backend.control_dt
        # On a real table the velocity is delayed, so the last command replaces it.
        last = state.velocity
        if isinstance(self._backend, LiveBackend):
            last = before.realized.velocity
        moved = state.position, last, before.realized.acceleration
        if not self._lags:
            return [limits_stage(action, prescribed, moved, *shared, after.realized)]
        old, new = before.commanded, after.commanded
        commanded = state.position, old.velocity, old.acceleration
        servo = servo_stage(
            (old.velocity, new.velocity),
            state.velocity,
            (before.rate, after.rate),
            physics["servo_time"],
            top,
            reach,
            self._backend.control_dt,
            self._response,
        )
        # The limits apply twice, as the response must stay in the workspace as well.
        return [
            limits_stage(action, prescribed, commanded, *shared, new),
            servo,
            limits_stage(self._response, prescribed, moved, *shared, after.realized),
        ]

    def _pipeline(self, before: Moment, after: Moment) -> Pipeline:
        state, velocity = before.state, after.realized.velocity
        command = Command(velocity, *self.inputs[1:])
        step = Step(
            *(state, velocity, after.state, before.verdict.memory),
            *(before.episode, self._limit),
        )
        stages = [
            *self._limits(before, after),
            self._backend.stage(command, state, after.state),
            self._referee.stage(step, after.verdict),
            *self._observer.stage(after.state, after.verdict.memory, after.shown),
        ]
        return Pipeline(len(self._limit), stages, self._name)


def _check_memory(old: Memory, new: Memory) -> None:
    """Check that a step changes no type and no shape of a memory."""
    for name in old.keys() | new.keys():
        kinds = [
            f"{m[name].dtype} {m[name].shape}" if name in m else "nothing"
            for m in (old, new)
        ]
        if kinds[0] != kinds[1]:
            raise ValueError(
                f"memory {name!r}: `initial_memory` returns {kinds[0]}, and a step "
                f"returns {kinds[1]}; both must be equal"
            )
