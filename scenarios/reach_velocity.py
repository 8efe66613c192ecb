"""Pass a goal with a target velocity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    GoalScenario,
    Mark,
    Memory,
    Metres,
    RandomStreams,
    Scene,
    Seconds,
    Speed,
    State,
    Transition,
    cos,
    length,
    observables,
    sin,
    starts,
)
from marl_airhockey.toolkit.rewards import tolerance


@dataclass(frozen=True, kw_only=True)
class ReachVelocity(GoalScenario):
    """Task of passing a goal with a target velocity.

    The reward is the best match of position and velocity so far. As a running maximum
    it cannot be collected twice. There is one pass: the episode ends ``window`` seconds
    after the paddle has entered the circle, so that circling the goal with rising speed
    does not succeed. With ``goals="dict"`` the episode ends when the goal is met.

    Start:
        The paddle is near the home end. The goal is sampled from the workspace, at
        least ``margin`` from its edges, so that the target velocity is feasible. The
        target speed is between ``slow`` and ``fast``, in any direction.

    Termination:
        The end of the pass.
    """

    title: ClassVar[str] = "Pass the circle at speed"
    version: ClassVar[int] = 1
    seconds: Seconds = 5.0
    radius: Metres = 0.04
    """Distance from the goal that counts as arrival, m."""
    error: Speed = 0.10
    """Largest error of the velocity, m/s."""
    window: Seconds = 0.2
    """Duration of the pass, from the first entry of the circle, s."""
    slow: Speed = 0.2
    """Lowest target speed at the goal, m/s."""
    fast: Speed = 0.5
    """Highest target speed at the goal, m/s."""
    margin: Metres = 0.08
    """Smallest distance of the goal from every edge of the workspace, m."""

    @cached_property
    def scene(self) -> Scene:
        return Scene(self.table_geometry, (self.seat(),))

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        goal = starts.inside(rng, self.scene, 0, self.margin)
        angle = rng.uniform(-np.pi, np.pi)
        speed = rng.uniform(self.slow, self.fast)[:, None]
        velocity = speed * np.stack([cos(angle), sin(angle)], -1)
        gap = length(state.paddle[:, 0] - goal)
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "goal": goal,
            "goal_velocity": velocity,
            "gap": gap,
            "score": np.zeros(worlds),
            "left": np.full(worlds, np.inf),
            "passed": np.zeros(worlds, np.bool_),
        }

    def update_memory(self, t: Transition) -> Memory:
        gap = length(t.after.paddle[..., 0, :] - t.memory["goal"])
        error = length(t.after.paddle_velocity[..., 0, :] - t.memory["goal_velocity"])
        score = tolerance(gap, 0.0, 0.10) * tolerance(error, 0.0, 0.30)
        left = t.memory["left"] - (t.after.time - t.before.time)
        enters = np.isinf(left) & (gap < self.radius)
        return {
            "gap": np.minimum(t.memory["gap"], gap),
            "score": np.maximum(t.memory["score"], score),
            "left": np.where(enters, self.window, left),
            "passed": (gap < self.radius) & (error < self.error),
        }

    observation = (
        observables.OwnPaddle(),
        observables.Goal((0.2, 0.2), -0.55, "own"),
        observables.GoalVelocity(1.0, 0.5),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        progress: Decrease of the shortest distance between paddle and goal so far, m.
        score: 3 times the increase of the best score of position and velocity so far.
        time: -0.02 in each step.
        success: 2, once.
        """
        return {
            "progress": (t.memory["gap"] - t.new_memory["gap"])[..., None],
            "score": 3.0 * (t.new_memory["score"] - t.memory["score"])[..., None],
            "time": np.full((*t.after.time.shape, 1), -0.02),
            "success": 2.0 * self.success(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        over = t.new_memory["left"] < 1e-9
        return np.asarray(self.success(t) | over)

    def success(self, t: Transition) -> Array:
        """(...) bool: The paddle met the goal in position and velocity in one step."""
        return t.new_memory["passed"]

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: The paddle is close to the goal, with a similar velocity.

        The distance is at most a tenth of the table's diagonal. The score of the
        velocity is at least 0.8. It is the mean of (1 + cosine) / 2 and
        1 - (error of the speed) / (2.83 m/s).
        """
        gap = length(t.after.paddle[..., 0, :] - t.memory["goal"])
        velocity, wanted = t.after.paddle_velocity[..., 0, :], t.memory["goal_velocity"]
        speed, wanted_speed = length(velocity), length(wanted)
        cosine = (velocity * wanted).sum(-1) / (speed * wanted_speed + 1e-8)
        alike = 1 - np.abs(speed - wanted_speed) / np.sqrt(8.0)
        score = ((1 + cosine) / 2 + alike) / 2
        tenth = 0.1 * length(self.table_geometry.size)
        return np.asarray((gap <= tenth) & (score >= 0.8))

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

    def caption(self, memory: Memory) -> Caption:
        return Caption("best match {:.0f} %", 100 * memory["score"])


make = ReachVelocity
