"""Hit the falling puck back up fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey import rewards, starts, views
from marl_airhockey.cast import Cast, Mouth
from marl_airhockey.draws import Draws
from marl_airhockey.scenario import Scenario
from marl_airhockey.state import Array, Memory, State


@dataclass(frozen=True, kw_only=True)
class PuckVelocity(Scenario):
    """The best upward speed after a touch is rewarded, and so is going to the puck."""

    seconds: float = 5.0
    fast: float = 1.5
    """m/s: wanted upward speed."""

    @cached_property
    def cast(self) -> Cast:
        home = Mouth("home", 0)
        return Cast(self.table_geometry, (self.seat(),), pucks=1, mouths=(home,))

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(draws, self.cast)
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "rise": np.zeros(worlds),
        }

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        rise = after.puck_velocity[..., 0, 0] * rewards.touched(memory)
        return {
            "gap": rewards.nearest(memory, after),
            "rise": np.maximum(memory["rise"], rise),
        }

    observation = (views.Own(), views.Pucks(), views.PucksFromOwn(), views.Touched())

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
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
