"""Move the paddle to a goal and stop there."""

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
    length,
    observables,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class Reach(GoalScenario):
    """Task of moving the paddle to a goal and stopping there.

    A paddle that drives through the goal does not succeed: it must be at rest for
    ``hold`` seconds.

    Start:
        The paddle is near the home end. The goal is sampled uniformly from the
        workspace, at least ``far`` from the paddle.

    Termination:
        Success.
    """

    title: ClassVar[str] = "Reach the circle"
    version: ClassVar[int] = 1
    seconds: Seconds = 3.0
    radius: Metres = 0.02
    """Distance from the goal that counts as arrival, m."""
    speed: Speed = 0.05
    """Speed below which the paddle is at rest, m/s."""
    hold: Seconds = 0.1
    """Time for which the paddle must be at rest, s."""
    far: Metres = 0.15
    """Smallest distance between goal and paddle at the start, m."""

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
            "gap": length(paddle - goal),
            "still": np.zeros(len(rng)),
        }

    def update_memory(self, t: Transition) -> Memory:
        rests = length(t.after.paddle_velocity[..., 0, :]) < self.speed
        still = t.memory["still"] + (t.after.time - t.before.time)
        return {
            "gap": length(t.after.paddle[..., 0, :] - t.memory["goal"]),
            "still": np.where(rests, still, 0.0),
        }

    def _rests(self, memory: Memory) -> Array:
        """Return True (...) if the paddle has been at rest for ``hold`` seconds."""
        return np.asarray(memory["still"] >= self.hold - 1e-9)

    observation = (observables.OwnPaddle(), observables.Goal((0.2, 0.2), -0.55, "own"))

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        progress: 2 times the decrease of the distance between paddle and goal, m.
        time: -0.02 in each step.
        success: 2, once.
        """
        return {
            "progress": 2.0 * (t.memory["gap"] - t.new_memory["gap"])[..., None],
            "time": np.full((*t.after.time.shape, 1), -0.02),
            "success": 2.0 * self.success(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return self.success(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: The paddle has come to rest within ``radius`` of the goal."""
        near = t.new_memory["gap"] < self.radius
        return np.asarray(near & self._rests(t.new_memory))

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: The paddle is within 0.05 m of the goal, at any speed."""
        return np.asarray(t.new_memory["gap"] < 0.05)

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        return (*self.table_geometry.size / 2, 1.5 * self.scene.seats[0].speed)

    def achieved(self, state: State, memory: Memory) -> Array:
        # A paddle that has not been at rest for long enough counts as moving.
        speed = length(state.paddle_velocity[..., 0, :])
        speed = np.where(self._rests(memory), 0.0, np.maximum(speed, 2.0 * self.speed))
        return np.concatenate([state.paddle[..., 0, :], speed[..., None]], -1)

    def desired(self, memory: Memory) -> Array:
        goal = memory["goal"]
        return np.concatenate([goal, np.zeros((*goal.shape[:-1], 1))], -1)

    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        near = length(achieved[..., :2] - desired[..., :2]) < self.radius
        error = np.abs(achieved[..., 2] - desired[..., 2])
        met: Array = 1.0 * (near & (error < self.speed))
        return met

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        return [Mark.circle(memory["goal"], self.radius)]

    def caption(self, memory: Memory) -> Caption:
        numbers = 100 * memory["gap"], 100 * self.radius
        return Caption("distance {:.1f} cm, needs {:.0f} cm", *numbers)


make = Reach
