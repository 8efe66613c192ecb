"""Strike a falling puck into a circle."""

from __future__ import annotations

from dataclasses import dataclass
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
    Seconds,
    State,
    Transition,
    length,
    observables,
    rewards,
    starts,
)
from marl_airhockey.toolkit.falling import FewShots


@dataclass(frozen=True, kw_only=True)
class HitGoal(FewShots, GoalScenario):
    """Task of striking a falling puck into a circle.

    Only a puck that was touched and rises counts, because a falling puck crosses the
    circle by chance. It must enter the circle after one of the first ``shots`` touches.

    Start:
        The paddle is near the home end. The puck falls from the far half. The centre of
        the circle is sampled uniformly from the far half.

    Termination:
        Success, a touch after the last shot, or the puck crosses the home line.
    """

    title: ClassVar[str] = "Hit the circle"
    version: ClassVar[int] = 1
    PATH = True
    seconds: Seconds = 10.0
    radius: Metres = 0.04
    """Radius of the circle, m."""

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds, table = len(rng), self.scene.table
        return {
            **super().initial_memory(state, rng),
            "goal": starts.uniform_box(rng, table, (0.05, 0.60), (-0.205, 0.205)),
            "near": np.full(worlds, np.inf),
            "entered": np.zeros(worlds, np.bool_),
        }

    def update_memory(self, t: Transition) -> Memory:
        goal = t.memory["goal"]
        entered, gap, _ = rewards.enters(t, goal, self.radius)
        return {
            "gap": rewards.nearest(t),
            "near": np.minimum(t.memory["near"], gap.min(-1)),
            "entered": t.memory["entered"]
            | (entered & self.within_shots(t.new_memory)),
        }

    observation = (
        *FewShots.observation,
        observables.Goal((0.3, 0.2), 0.31, "puck"),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        aim: 2 times the decrease of the shortest distance between the struck puck and
        the goal so far, m.
        success: 3, once.
        drop: -1 when the puck crosses the home line.
        """
        return {
            "approach": rewards.approach(t),
            "aim": 2.0
            * rewards.gained(t.memory["near"], t.new_memory["near"])[..., None],
            "success": 3.0
            * (t.new_memory["entered"] & ~t.memory["entered"])[..., None],
            "drop": -1.0 * rewards.lost(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        over = rewards.lost(t) | ~self.within_shots(t.new_memory)
        return np.asarray(t.new_memory["entered"] | over)

    def success(self, t: Transition) -> Array:
        """(...) bool: A rising puck was in the circle within ``shots`` touches."""
        return t.new_memory["entered"]

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: The puck is within 0.15 m of the goal and rises."""
        puck, velocity = t.after.puck[..., 0, :], t.after.puck_velocity[..., 0, :]
        near = length(puck - t.memory["goal"]) < 0.15
        return np.asarray(near & (velocity[..., 0] > 0))

    @property
    def goal_bounds(self) -> tuple[float, ...]:
        return (*self.table_geometry.size / 2, 1.0)

    def achieved(self, state: State, memory: Memory) -> Array:
        shot = rewards.touched(memory) & self.within_shots(memory)
        rising = shot & (state.puck_velocity[..., 0, 0] > 0)
        return np.concatenate([state.puck[..., 0, :], 1.0 * rising[..., None]], -1)

    def desired(self, memory: Memory) -> Array:
        goal = memory["goal"]
        return np.concatenate([goal, np.ones((*goal.shape[:-1], 1))], -1)

    def goal_reward(self, achieved: Array, desired: Array) -> Array:
        near = length(achieved[..., :2] - desired[..., :2]) < self.radius
        return 1.0 * (near & (achieved[..., 2] > 0.5))

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        return [Mark.circle(memory["goal"], self.radius)]

    def caption(self, memory: Memory) -> Caption:
        numbers = 100 * memory["near"], 100 * self.radius
        return Caption("closest {:.0f} cm, needs {:.0f} cm", *numbers)


make = HitGoal
