"""Hit the falling puck back up fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class PuckVelocity(Scenario):
    """The best upward speed after a touch is rewarded, and so is going to the puck."""

    seconds: float = 5.0
    fast: float = 1.5
    """m/s: wanted upward speed."""

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        return Scene(self.table_geometry, (self.seat(),), pucks=1, goal_lines=(home,))

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "rise": np.zeros(worlds),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        rise = after.puck_velocity[..., 0, 0] * rewards.touched(memory)
        return {
            "gap": rewards.nearest(memory, after),
            "rise": np.maximum(memory["rise"], rise),
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
            "rise": (new["rise"] - old["rise"])[..., None],
            "success": 2.0 * self.success(after, new)[..., None],
            "drop": -1.0 * after.crossed[..., 0, :1],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return self.success(after, memory) | after.crossed[..., 0, 0]

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["rise"] >= self.fast)


make = PuckVelocity
