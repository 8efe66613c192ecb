"""Known: what seats know at a moment, from which their actions follow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory


class Known(NamedTuple):
    """What the seats of B worlds know at a moment, see `World.known`.

    All that chooses actions takes this object, so that a driver observes the same in an
    environment, in a game of many, in a browser and in an evaluation.
    """

    sensed: State
    """Sensed state, table frame"""
    memory: Memory
    """Memory of the scenario as it follows from what is sensed, (B, ...) each"""
    physics: dict[str, Array]
    """Physical parameters of the running episodes, (B,) each"""
    cycles: Array
    """(B,) control steps since the episodes began"""

    def copied(self) -> Known:
        """Return the same with arrays of its own, but for the physics."""
        memory = {name: array.copy() for name, array in self.memory.items()}
        sensed, cycles = self.sensed.map(np.copy), self.cycles.copy()
        return Known(sensed, memory, self.physics, cycles)
