"""Strike a falling puck through a circle with a target velocity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    Degrees,
    GoalScenario,
    Mark,
    Memory,
    Metres,
    RandomStreams,
    Seconds,
    Share,
    Speed,
    State,
    Transition,
    exp,
    length,
    observables,
    rewards,
    starts,
)
from marl_airhockey.toolkit.falling import FewShots
from marl_airhockey.toolkit.shots import draw_shots, playable_puck


@dataclass(frozen=True, kw_only=True)
class HitGoalVelocity(FewShots, GoalScenario):
    """Task of striking a falling puck through a circle with a target velocity.

    The goal is the position and velocity of the puck at one instant of a feasible shot,
    which is simulated with the physics of this episode (see `shots.draw_shots`). The
    puck must meet it after one of the first ``shots`` touches.

    Start:
        The paddle is near the home end. The puck falls from the far half into the
        workspace. The goal is a point of a feasible shot in the far half.

    Termination:
        Success, a touch after the last shot, or the puck crosses the home line.
    """

    title: ClassVar[str] = "Hit the circle at speed"
    version: ClassVar[int] = 1
    PATH = True
    seconds: Seconds = 10.0
    shots: int = 1
    """Number of distinct touches within which the task must succeed."""
    radius: Metres = 0.09
    """Radius of the circle, m."""
    angle: Degrees = 15.0
    """Largest angle to the target velocity, deg."""
    speed_share: Share = 0.20
    """Largest error of the speed, as a share of the target speed."""
    speed_slack: Speed = 0.05
    """Additional error of the speed, m/s."""

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state, puck = starts.falling(rng, self.scene), playable_puck(rng, self.scene)
        state.position[:, 1], state.velocity[:, 1] = puck[:, :2], puck[:, 2:4]
        state.spin[:, 1] = puck[:, 4] / self.scene.table.puck_radius
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "goal": np.zeros((worlds, 2)),
            "goal_velocity": np.zeros((worlds, 2)),
            "score": np.zeros(worlds),
            "entered": np.zeros(worlds, np.bool_),
        }

    def finalize_goals(
        self,
        rng: RandomStreams,
        state: State,
        memory: Memory,
        physics: Mapping[str, Array],
    ) -> Memory:
        goal = draw_shots(rng, self.scene, state, physics)
        return {
            **memory,
            "goal": goal[:, :2].copy(),
            "goal_velocity": goal[:, 2:].copy(),
        }

    def update_memory(self, t: Transition) -> Memory:
        entered, gap, error = rewards.enters(
            t,
            t.memory["goal"],
            self.radius,
            t.memory["goal_velocity"],
            np.radians(self.angle),
            self.speed_share,
            self.speed_slack,
        )
        near = exp(-4.0 * np.maximum(gap, 0.0))
        score = (near * (0.3 + 0.7 * exp(-1.5 * error))).max(-1)
        return {
            "gap": rewards.nearest(t),
            "score": np.maximum(t.memory["score"], score),
            "entered": t.memory["entered"]
            | (entered & self.within_shots(t.new_memory)),
        }

    observation = (
        *FewShots.observation,
        observables.Goal((0.3, 0.2), 0.31, "puck"),
        observables.GoalVelocity(2.5, 0.6),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        score: 3 times the increase of the best score of position and velocity so far.
        success: 3, once.
        drop: -1 when the puck crosses the home line.
        """
        return {
            "approach": rewards.approach(t),
            "score": 3.0 * (t.new_memory["score"] - t.memory["score"])[..., None],
            "success": 3.0
            * (t.new_memory["entered"] & ~t.memory["entered"])[..., None],
            "drop": -1.0 * rewards.lost(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        over = rewards.lost(t) | ~self.within_shots(t.new_memory)
        return np.asarray(t.new_memory["entered"] | over)

    def success(self, t: Transition) -> Array:
        """(...) bool: A rising puck met the goal in position and velocity.

        It met both at one instant, after at most ``shots`` touches.
        """
        return t.new_memory["entered"]

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: The puck is within 0.1012 m of the goal, at any velocity."""
        gap = length(t.after.puck[..., 0, :] - t.memory["goal"])
        return np.asarray(gap < 0.1012)

    def targets(self, memory: Memory) -> Array | None:
        return None  # Goals are sampled after the start, see `finalize_goals`.

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        return (*self.table_geometry.size / 2, 5.0, 5.0, 1.0)

    def achieved(self, state: State, memory: Memory) -> Array:
        puck, velocity = state.puck[..., 0, :], state.puck_velocity[..., 0, :]
        shot = rewards.touched(memory) & self.within_shots(memory)
        rising = shot & (velocity[..., 0] > 0)
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

    def caption(self, memory: Memory) -> Caption:
        return Caption("best match {:.0f} %", 100 * memory["score"])


make = HitGoalVelocity
