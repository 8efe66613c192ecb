"""Move the paddle to a goal and hold it there for two steps."""

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
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Reach(GoalScenario):
    """Progress toward the goal is rewarded, time costs, arriving pays once.

    The goal is at least ``far`` from the paddle, so that standing still never succeeds.
    """

    seconds: float = 3.0
    radius: float = 0.02
    """m: how close is there."""
    far: float = 0.15
    """m: shortest distance of a goal from the paddle."""

    @cached_property
    def scene(self) -> Scene:
        return Scene(self.table_geometry, (self.seat(),))

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        paddle = state.paddle[:, 0]

        def sample(some: RandomStreams) -> Array:
            return starts.inside(some, self.scene, 0)

        goal = starts.redraw(
            rng, sample, lambda rows: length(rows - paddle) >= self.far
        )
        return state, {
            "goal": goal,
            "was": paddle.copy(),
            "here": paddle.copy(),
            "gap": length(paddle - goal),
            "held": np.zeros(worlds, np.int64),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        here = after.paddle[..., 0, :]
        gap = length(here - memory["goal"])
        return {
            "was": before.paddle[..., 0, :],
            "here": here,
            "gap": gap,
            "held": np.where(gap < self.radius, memory["held"] + 1, 0),
        }

    observation = (observables.OwnPaddle(), observables.Goal((0.2, 0.2), -0.55, "own"))

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "progress": 2.0 * (old["gap"] - new["gap"])[..., None],
            "time": np.full((*after.time.shape, 1), -0.02),
            "success": 2.0 * self.success(after, new)[..., None],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return self.success(after, memory)

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["held"] >= 2)

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        return (*self.table_geometry.size / 2, *self.table_geometry.size / 2)

    def achieved(self, state: State, memory: Memory) -> Array:
        return np.concatenate([memory["here"], memory["was"]], -1)

    def desired(self, memory: Memory) -> Array:
        return np.concatenate([memory["goal"], memory["goal"]], -1)

    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        gap = achieved - desired
        near = length(gap[..., :2]) < self.radius
        return 1.0 * (near & (length(gap[..., 2:]) < self.radius))

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        return [Mark.circle(memory["goal"], self.radius)]


make = Reach
