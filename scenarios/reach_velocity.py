"""Pass through a goal with a wanted velocity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.contracts.scenario import GoalScenario
from marl_airhockey.core.geometry import length
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import starts
from marl_airhockey.toolkit.rewards import tolerance
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class ReachVelocity(GoalScenario):
    """The best closeness so far, in place and in velocity together, is rewarded.

    Being a best so far it cannot be farmed; the goal lies ``margin`` inside the reach,
    so that its velocity can be had there in any direction.
    """

    seconds: float = 5.0
    radius: float = 0.04
    """m: how close is there."""
    error: float = 0.10
    """m/s: largest error of the velocity."""
    slow: float = 0.2
    fast: float = 0.5
    """m/s: range of the wanted speed."""
    margin: float = 0.08
    """m: distance of a goal from every edge of the reach."""

    @cached_property
    def scene(self) -> Scene:
        return Scene(self.table_geometry, (self.seat(),))

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        goal = starts.inside(rng, self.scene, 0, self.margin)
        angle = rng.uniform(-np.pi, np.pi)
        speed = rng.uniform(self.slow, self.fast)[:, None]
        velocity = speed * np.stack([np.cos(angle), np.sin(angle)], -1)
        gap = length(state.paddle[:, 0] - goal)
        return state, {
            "goal": goal,
            "goal_velocity": velocity,
            "gap": gap,
            "score": np.zeros(worlds),
            "passed": np.zeros(worlds, np.bool_),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        gap = length(after.paddle[..., 0, :] - memory["goal"])
        error = length(after.paddle_velocity[..., 0, :] - memory["goal_velocity"])
        score = tolerance(gap, 0.0, 0.10) * tolerance(error, 0.0, 0.30)
        return {
            "gap": np.minimum(memory["gap"], gap),
            "score": np.maximum(memory["score"], score),
            "passed": (gap < self.radius) & (error < self.error),
        }

    observation = (
        observables.OwnPaddle(),
        observables.Goal((0.2, 0.2), -0.55, "own"),
        observables.GoalVelocity(1.0, 0.5),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "progress": (old["gap"] - new["gap"])[..., None],
            "score": 3.0 * (new["score"] - old["score"])[..., None],
            "time": np.full((*after.time.shape, 1), -0.02),
            "success": 2.0 * self.success(after, new)[..., None],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return self.success(after, memory)

    def success(self, after: State, memory: Memory) -> Array:
        return memory["passed"]

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        top = 1.5 * self.scene.seats[0].speed
        return (*self.table_geometry.size / 2, top, top)

    def achieved(self, state: State, memory: Memory) -> Array:
        both = state.paddle[..., 0, :], state.paddle_velocity[..., 0, :]
        return np.concatenate(both, -1)

    def desired(self, memory: Memory) -> Array:
        return np.concatenate([memory["goal"], memory["goal_velocity"]], -1)

    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        gap = achieved - desired
        near = length(gap[..., :2]) < self.radius
        return 1.0 * (near & (length(gap[..., 2:]) < self.error))

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        goal, velocity = memory["goal"], memory["goal_velocity"]
        return [Mark.circle(goal, self.radius), Mark.arrow(goal, 0.2 * velocity)]


make = ReachVelocity
