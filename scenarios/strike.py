"""Strike a resting puck so that it leaves fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.geometry import length
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Strike(Scenario):
    """The best speed of the puck so far is rewarded, and so is going to it.

    Success wants speed and way at one step: a puck pushed along is not struck. From
    rest a 0.7 m/s paddle gives at most 1.295 m/s.
    """

    seconds: float = 2.0
    fast: float = 1.0
    """m/s: wanted speed of the puck."""
    way: float = 0.3
    """m: wanted distance from where it lay."""

    @cached_property
    def scene(self) -> Scene:
        flat = {"tilt": 0.0}
        return Scene(self.table_geometry, (self.seat(),), pucks=1, physics=flat)

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.first_state(self.scene, worlds)
        state.position[:, 0] = starts.place(rng, (-0.74, -0.64), starts.PADDLE_Y)
        state.position[:, 1] = starts.place(rng, (-0.49, -0.32), (-0.20, 0.20))
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "origin": state.puck[:, 0].copy(),
            "speed": np.zeros(worlds),
            "struck": np.zeros(worlds, np.bool_),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        speed = length(after.puck_velocity[..., 0, :])
        away = length(after.puck[..., 0, :] - memory["origin"]) >= self.way
        return {
            "gap": rewards.nearest(memory, after),
            "speed": np.maximum(memory["speed"], speed),
            "struck": memory["struck"] | (away & (speed >= self.fast)),
        }

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "approach": (old["gap"] - new["gap"])[..., None],
            "speed": (new["speed"] - old["speed"])[..., None],
            "time": np.full((*after.time.shape, 1), -0.01),
            "success": 2.0 * (new["struck"] & ~old["struck"])[..., None],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return memory["struck"]

    def success(self, after: State, memory: Memory) -> Array:
        return memory["struck"]


make = Strike
