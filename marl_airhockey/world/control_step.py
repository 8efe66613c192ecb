"""Control step: limits, physics and rules as one pipeline on arrays that stay."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.contracts.backend import Backend, Command
from marl_airhockey.core.limits import INFINITE, Limited, limits_stage
from marl_airhockey.core.rows import clear_rows
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.core.state import State
from marl_airhockey.jit.pipeline import Pipeline
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.episode import Episode
from marl_airhockey.world.referee import Referee, Step, Verdict


class Moment(NamedTuple):
    """State of B worlds and of their episodes, and the step that led to it."""

    state: State
    limited: Limited
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
    ) -> None:
        self._backend, self._referee, self._reach = backend, referee, reach
        self._limit, self._name = limit, referee.scenario.name
        b, seats = len(limit), len(reach.share)
        self.action = np.zeros((b, seats, 2))
        """(B, seats, 2) actions after their delay: fractions of top speed, ego frames;
        to be filled, like the next three"""
        still = Command.still(backend.scene, b)
        self.prescribed, self.closed = still.prescribed, still.closed
        self.raised = still.raised
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
        step = Step(here, limited.velocity, here, memory, episode, self._limit)
        verdict = self._referee.prepare(step)
        _check_memory(memory, verdict.memory)
        return Moment(here, limited, verdict, episode.counted(verdict.counters))

    def _compile(self) -> None:
        first, second = self._moments
        pairs = (first, second), (second, first)
        self._pipelines = [self._pipeline(*pair) for pair in pairs]

    def _pipeline(self, before: Moment, after: Moment) -> Pipeline:
        state, physics = before.state, before.episode.physics
        limits = limits_stage(
            self.action,
            self.prescribed,
            (state.position, state.velocity, before.limited.acceleration),
            self._reach,
            (physics["paddle_speed"], physics["paddle_acceleration"]),
            self._backend.control_dt,
            after.limited,
        )
        velocity = after.limited.velocity
        command = Command(velocity, self.prescribed, self.closed, self.raised)
        step = Step(
            *(state, velocity, after.state, before.verdict.memory),
            *(before.episode, self._limit),
        )
        stages = [
            limits,
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
