"""Sensed memory: the memory of a scenario that seats know with simulated sensing.

The rules use the true state. Seats know a contact only after a camera frame shows it.
The memory in observations is therefore computed from sensed states, by the same
functions.
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
        scenario: Scenario of the memory.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.now: Memory = {}
        """Arrays by name (B, ...)."""
        self._fused = Fused(self._next, scenario.name)

    def begin(self, worlds: Array, memory: Memory) -> None:
        """Copy the true memory of some worlds, by index (W,), when an episode begins.

        Call it also after a serve, because the referee announces the events before it.
        """
        for name, array in memory.items():
            mine = self.now.setdefault(name, array.copy())
            mine[worlds] = array[worlds]

    def update(
        self, before: State, command: Array, after: State, memory: Memory
    ) -> None:
        """Update the memory after a step of all worlds.

        Args:
            before: Sensed state before the step.
            command: Commanded velocities (B, seats, 2), table frame, m/s.
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
