"""Move the paddle to a goal and hold it there for two steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    GoalScenario,
    Mark,
    Memory,
    RandomStreams,
    Scene,
    State,
    Transition,
    length,
    observables,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class Reach(GoalScenario):
    """Task that rewards progress toward the goal and, once, arrival; time costs.

    The goal is at least ``far`` from the paddle, so that standing still never succeeds.
    """

    seconds: float = 3.0
    radius: float = 0.02
    """Distance that counts as arrival (m)."""
    far: float = 0.15
    """Shortest initial distance of a goal from the paddle (m)."""

    @cached_property
    def scene(self) -> Scene:
        return Scene(self.table_geometry, (self.seat(),))

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        paddle = state.paddle[:, 0]

        def sample(some: RandomStreams) -> Array:
            return starts.inside(some, self.scene, 0)

        goal = starts.redraw(
            rng, sample, lambda rows: length(rows - paddle) >= self.far
        )
        return {
            **super().initial_memory(state, rng),
            "goal": goal,
            "was": paddle.copy(),
            "here": paddle.copy(),
            "gap": length(paddle - goal),
            "held": np.zeros(len(rng), np.int64),
        }

    def update_memory(self, t: Transition) -> Memory:
        here = t.after.paddle[..., 0, :]
        gap = length(here - t.memory["goal"])
        return {
            "was": t.before.paddle[..., 0, :],
            "here": here,
            "gap": gap,
            "held": np.where(gap < self.radius, t.memory["held"] + 1, 0),
        }

    observation = (observables.OwnPaddle(), observables.Goal((0.2, 0.2), -0.55, "own"))

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the terms.

        progress: 2 times the metres by which the gap to the goal shrank.
        time: -0.02 a step.
        success: 2 once.
        """
        return {
            "progress": 2.0 * (t.memory["gap"] - t.new_memory["gap"])[..., None],
            "time": np.full((*t.after.time.shape, 1), -0.02),
            "success": 2.0 * self.success(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return self.success(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: the paddle has been within the radius for two steps on end."""
        return np.asarray(t.new_memory["held"] >= 2)

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
