"""Hit the falling puck into a goal circle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.contracts.scenario import GoalScenario
from marl_airhockey.core.geometry import length
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class HitGoal(GoalScenario):
    """The rising puck's nearing the circle is rewarded, best so far, by the metre.

    Only a touched and rising puck counts: a falling one crosses the circle by chance.
    """

    seconds: float = 10.0
    radius: float = 0.10
    """m, of the circle."""

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        seats = (self.seat(),)
        return Scene(self.table_geometry, seats, pucks=1, goal_lines=(home,), path=True)

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "goal": starts.place(rng, (0.05, 0.738), (-0.205, 0.205)),
            "near": np.full(worlds, np.inf),
            "entered": np.zeros(worlds, np.bool_),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        goal = memory["goal"]
        entered, gap, _ = rewards.enters(memory, before, after, goal, self.radius)
        return {
            "gap": rewards.nearest(memory, after),
            "near": np.minimum(memory["near"], gap.min(-1)),
            "entered": memory["entered"] | entered,
        }

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.Goal((0.3, 0.2), 0.31, "puck"),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "approach": (old["gap"] - new["gap"])[..., None],
            "aim": 2.0 * rewards.gained(old["near"], new["near"])[..., None],
            "success": 3.0 * (new["entered"] & ~old["entered"])[..., None],
            "drop": -1.0 * after.crossed[..., 0, :1],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return memory["entered"] | after.crossed[..., 0, 0]

    def success(self, after: State, memory: Memory) -> Array:
        return memory["entered"]

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        return (*self.table_geometry.size / 2, 1.0)

    def achieved(self, state: State, memory: Memory) -> Array:
        rising = rewards.touched(memory) & (state.puck_velocity[..., 0, 0] > 0)
        return np.concatenate([state.puck[..., 0, :], 1.0 * rising[..., None]], -1)

    def desired(self, memory: Memory) -> Array:
        goal = memory["goal"]
        return np.concatenate([goal, np.ones((*goal.shape[:-1], 1))], -1)

    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        near = length(achieved[..., :2] - desired[..., :2]) < self.radius
        return 1.0 * (near & (achieved[..., 2] > 0.5))

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        return [Mark.circle(memory["goal"], self.radius)]


make = HitGoal
