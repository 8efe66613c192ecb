"""Move the paddle to a goal and hold it there for two steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey import starts, views
from marl_airhockey.cast import Cast
from marl_airhockey.draws import Draws
from marl_airhockey.rewards import length
from marl_airhockey.scenario import GoalScenario, Mark
from marl_airhockey.state import Array, Memory, State


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
    def cast(self) -> Cast:
        return Cast(self.table_geometry, (self.seat(),))

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(draws, self.cast)
        paddle = state.paddle[:, 0]

        def sample(some: Draws) -> Array:
            return starts.inside(some, self.cast, 0)

        goal = starts.redraw(
            draws, sample, lambda rows: length(rows - paddle) >= self.far
        )
        return state, {
            "goal": goal,
            "was": paddle.copy(),
            "here": paddle.copy(),
            "gap": length(paddle - goal),
            "held": np.zeros(worlds, np.int64),
        }

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        here = after.paddle[..., 0, :]
        gap = length(here - memory["goal"])
        return {
            "was": before.paddle[..., 0, :],
            "here": here,
            "gap": gap,
            "held": np.where(gap < self.radius, memory["held"] + 1, 0),
        }

    observation = (views.Own(), views.Goal((0.2, 0.2), -0.55, "own"))

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
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
