"""Sensed memory: the memory of a scenario as seats know it under simulated sensing.

The rules judge the true state. Seats know a contact only once a frame shows it, so what
observations show of the memory follows from the sensed states, by the same functions.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario, Transition
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Fused, Sink, Source
from marl_airhockey.types import Array, Memory


class SensedMemory:
    """Memory of the episodes of B worlds, from their sensed states.

    Args:
        scenario: Scenario whose memory it is.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.now: Memory = {}
        """Arrays by name, (B, ...)"""
        self._fused = Fused(self._next, scenario.name)

    def begin(self, worlds: Array, memory: Memory) -> None:
        """Take the true memory in some worlds, by index, where an episode begins.

        The same holds for a serve, with which the referee announces what has happened.
        """
        for name, array in memory.items():
            mine = self.now.setdefault(name, array.copy())
            mine[worlds] = array[worlds]

    def update(
        self, before: State, command: Array, after: State, memory: Memory
    ) -> None:
        """Follow a step of all worlds.

        Args:
            before: Sensed state before the step.
            command: Commands (B, seats, 2) of the step, m/s.
            after: Sensed state after the step.
            memory: True memory after the step.
        """
        (self.now,) = self._fused(
            *(vars(before), vars(after), self.now, memory, {"command": command})
        )

    def _next(
        self, first: Source, last: Source, known: Memory, true: Memory, action: Source
    ) -> tuple[Sink]:
        before, after = State(**first), State(**last)
        never = np.zeros(after.time.shape, np.bool_)
        t = Transition(before, action["command"], after, known, known, never)
        new = self._scenario.next_memory(t)
        return ({**new, **{name: true[name] for name in self._scenario.announced}},)
