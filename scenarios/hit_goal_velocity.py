"""Hit the falling puck into a goal circle with a wanted velocity."""

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
from marl_airhockey.toolkit.shots import legal_shots
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class HitGoalVelocity(GoalScenario):
    """The best closeness so far of the rising puck, in place and velocity, is rewarded.

    The goal is a moment of a legal shot at this very puck (see `shots.legal_shots`), so
    that it can be met.
    """

    seconds: float = 10.0
    radius: float = 0.10
    """m, of the circle."""
    angle: float = 15.0
    """deg: largest angle to the wanted velocity."""
    speed_share: float = 0.20
    """Largest error of the speed, as a share of the wanted one."""
    speed_slack: float = 0.05
    """m/s: this much more."""

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        seats = (self.seat(),)
        return Scene(self.table_geometry, seats, pucks=1, goal_lines=(home,), path=True)

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        puck, goal = legal_shots(rng, self.scene)
        state.position[:, 1], state.velocity[:, 1] = puck[:, :2], puck[:, 2:]
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "goal": goal[:, :2].copy(),
            "goal_velocity": goal[:, 2:].copy(),
            "score": np.zeros(worlds),
            "entered": np.zeros(worlds, np.bool_),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        entered, gap, error = rewards.enters(
            memory,
            before,
            after,
            memory["goal"],
            self.radius,
            memory["goal_velocity"],
            np.radians(self.angle),
            self.speed_share,
            self.speed_slack,
        )
        near = np.exp(-4.0 * np.maximum(gap, 0.0))
        score = (near * (0.3 + 0.7 * np.exp(-1.5 * error))).max(-1)
        return {
            "gap": rewards.nearest(memory, after),
            "score": np.maximum(memory["score"], score),
            "entered": memory["entered"] | entered,
        }

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.Goal((0.3, 0.2), 0.31, "puck"),
        observables.GoalVelocity(2.5, 0.6),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "approach": (old["gap"] - new["gap"])[..., None],
            "score": 3.0 * (new["score"] - old["score"])[..., None],
            "success": 3.0 * (new["entered"] & ~old["entered"])[..., None],
            "drop": -1.0 * after.crossed[..., 0, :1],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return memory["entered"] | after.crossed[..., 0, 0]

    def success(self, after: State, memory: Memory) -> Array:
        return memory["entered"]

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        return (*self.table_geometry.size / 2, 5.0, 5.0, 1.0)

    def achieved(self, state: State, memory: Memory) -> Array:
        puck, velocity = state.puck[..., 0, :], state.puck_velocity[..., 0, :]
        rising = rewards.touched(memory) & (velocity[..., 0] > 0)
        return np.concatenate([puck, velocity, 1.0 * rising[..., None]], -1)

    def desired(self, memory: Memory) -> Array:
        goal, velocity = memory["goal"], memory["goal_velocity"]
        return np.concatenate([goal, velocity, np.ones((*goal.shape[:-1], 1))], -1)

    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        near = length(achieved[..., :2] - desired[..., :2]) < self.radius
        return 1.0 * (
            near
            & (achieved[..., 4] > 0.5)
            & rewards.alike(
                achieved[..., 2:4],
                desired[..., 2:4],
                np.radians(self.angle),
                self.speed_share,
                self.speed_slack,
            )
        )

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        goal, velocity = memory["goal"], memory["goal_velocity"]
        return [Mark.circle(goal, self.radius), Mark.arrow(goal, 0.2 * velocity)]


make = HitGoalVelocity
