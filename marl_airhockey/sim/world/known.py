"""Known: the knowledge of all seats, from which drivers compute actions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory


class Known(NamedTuple):
    """Knowledge of the seats of B worlds at a moment, see `World.known`.

    Environments, rosters, the browser page and evaluations pass this object to drivers,
    so that a driver observes the same in all of them.
    """

    sensed: State
    """Sensed state, table frame."""
    memory: Memory
    """Memory of the scenario, computed from sensed states, arrays (B, ...)."""
    physics: dict[str, Array]
    """Physics parameters of the running episodes by name (B,)."""
    cycles: Array
    """Number of control steps since the episodes began (B,)."""

    def copied(self) -> Known:
        """Return a copy with new arrays, except for the physics."""
        memory = {name: array.copy() for name, array in self.memory.items()}
        sensed, cycles = self.sensed.map(np.copy), self.cycles.copy()
        return Known(sensed, memory, self.physics, cycles)
