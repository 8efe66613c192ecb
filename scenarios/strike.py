"""Strike a resting puck so that it leaves fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey import rewards, starts, views
from marl_airhockey.cast import Cast
from marl_airhockey.draws import Draws
from marl_airhockey.rewards import length
from marl_airhockey.scenario import Scenario
from marl_airhockey.state import Array, Memory, State


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
    def cast(self) -> Cast:
        flat = {"tilt": 0.0}
        return Cast(self.table_geometry, (self.seat(),), pucks=1, physics=flat)

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        state = starts.first_state(self.cast, worlds)
        state.position[:, 0] = starts.place(draws, (-0.74, -0.64), starts.PADDLE_Y)
        state.position[:, 1] = starts.place(draws, (-0.49, -0.32), (-0.20, 0.20))
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "origin": state.puck[:, 0].copy(),
            "speed": np.zeros(worlds),
            "struck": np.zeros(worlds, np.bool_),
        }

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        speed = length(after.puck_velocity[..., 0, :])
        away = length(after.puck[..., 0, :] - memory["origin"]) >= self.way
        return {
            "gap": rewards.nearest(memory, after),
            "speed": np.maximum(memory["speed"], speed),
            "struck": memory["struck"] | (away & (speed >= self.fast)),
        }

    observation = (views.Own(), views.Pucks(), views.PucksFromOwn(), views.Touched())

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
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
