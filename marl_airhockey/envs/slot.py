"""Slot: one environment of an `AirHockeyVecEnv`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from marl_airhockey.envs.attributes import CheckedAttributes
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory

if TYPE_CHECKING:
    from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv


class Slot(CheckedAttributes):
    """Single environment of one slot, with attributes and methods but without steps.

    It has the attributes and methods of `AirHockeySingleEnv` except `reset` and `step`,
    which move all slots. Learning libraries can store further attributes in it.

    Args:
        venv: Environment of all slots.
        index: Index of the slot.
    """

    def __init__(self, venv: AirHockeyVecEnv, index: int) -> None:
        self._venv, self._index = venv, index
        self._rows = np.array([venv.slots.world_of(index)])
        self.render_mode, self.metadata = venv.render_mode, venv.metadata
        self.observation_space = venv.observation_space
        self.action_space = venv.action_space
        self.world = venv.world

    @property
    def unwrapped(self) -> Slot:
        """The slot itself."""
        return self

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of the (flat part of the) observation."""
        return self.world.observer.labels

    @property
    def physics(self) -> dict[str, float]:
        """Physics parameters of the episode by name."""
        physics = self.world.episode.physics
        return {name: float(x[self._rows[0]]) for name, x in physics.items()}

    @property
    def max_cycles(self) -> int:
        """Length of an episode in control steps, of the slot's world."""
        return int(self.world.limits[self._rows[0]])

    @max_cycles.setter
    def max_cycles(self, cycles: int) -> None:
        self.world.limit_cycles(cycles, self._rows)

    def get_state(self) -> tuple[State, Memory]:
        """Return the true state and the memory, without an axis of worlds."""
        state, memory = self.world.get_state()
        i = self._rows[0]
        return state.map(lambda x: x[i]), {name: x[i] for name, x in memory.items()}

    def set_state(self, state: State, memory: Memory | None = None) -> Any:
        """Continue from a state, see `World.set_state`; return the observation."""
        seen = self._venv.set_state(state, memory, self._rows)
        if isinstance(seen, dict):
            return {name: value[self._index] for name, value in seen.items()}
        return seen[self._index]

    def compute_reward(self, achieved: Array, desired: Array, info: Any) -> Array:
        """Return the rewards of goals (..., G) with goals="dict" (...), float32."""
        return self._venv.compute_reward(achieved, desired, info)

    def render(self) -> Array | None:
        """Return an image (H, W, 3) uint8 of the slot's world."""
        return self._venv.get_images()[self._index]
