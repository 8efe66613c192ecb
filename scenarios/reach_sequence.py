"""Pass several goals in a given order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    Mark,
    Memory,
    Metres,
    RandomStreams,
    Scenario,
    Scene,
    Seconds,
    State,
    Transition,
    length,
    observables,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class ReachSequence(Scenario):
    """Task of passing several goals in a given order.

    The observation contains the current goal and the one after it, so that a
    trajectory through both can be planned. After the last goal there is no other: it is
    then observed twice.

    Start:
        The paddle is near the home end. Each goal is sampled from the workspace, at
        least ``far`` from the goal before it.

    Termination:
        Success.
    """

    title: ClassVar[str] = "Five circles in order"
    seconds: Seconds = 6.0
    count: int = 5
    """Number of goals."""
    radius: Metres = 0.03
    """Distance from a goal that counts as passage, m."""
    far: Metres = 0.12
    """Smallest distance of a goal from the previous one, or from the paddle, m."""

    @cached_property
    def scene(self) -> Scene:
        return Scene(self.table_geometry, (self.seat(),))

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        last, goals = state.paddle[:, 0], []
        for _ in range(self.count):

            def apart(rows: Array, last: Array = last) -> Array:
                return np.asarray(length(rows - last) >= self.far)

            last = starts.redraw(
                rng, lambda some: starts.inside(some, self.scene, 0), apart
            )
            goals.append(last)
        every = np.stack(goals, 1)
        return {
            **super().initial_memory(state, rng),
            "goals": every,
            "passed": np.zeros(len(rng)),
            "goal": every[:, 0].copy(),
            "next_goal": every[:, min(1, self.count - 1)].copy(),
            "gap": length(state.paddle[:, 0] - every[:, 0]),
        }

    def update_memory(self, t: Transition) -> Memory:
        own, old = t.after.paddle[..., 0, :], t.memory
        passes = length(own - old["goal"]) < self.radius
        passed = old["passed"] + passes
        goal, following = (self._goal(old, passed + k) for k in (0, 1))
        return {
            "passed": passed,
            "goal": goal,
            "next_goal": following,
            "gap": length(own - goal),
        }

    def _goal(self, memory: Memory, index: Array) -> Array:
        """Return the goal with an index (..., 2), m; the last goal if there is none."""
        kept = np.minimum(index, self.count - 1.0)[..., None]
        mine = kept == np.arange(self.count)
        return np.asarray((memory["goals"] * mine[..., None]).sum(-2))

    observation = (
        observables.OwnPaddle(),
        observables.Goal((0.2, 0.2), -0.55, "own"),
        observables.Goal((0.2, 0.2), -0.55, "own", "next_goal"),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        progress: 2 times the decrease of the distance from paddle to current goal, m.
        passage: 1 for each passed goal.
        time: -0.02 in each step.
        """
        gap = length(t.after.paddle[..., 0, :] - t.memory["goal"])
        return {
            "progress": 2.0 * (t.memory["gap"] - gap)[..., None],
            "passage": (t.new_memory["passed"] - t.memory["passed"])[..., None],
            "time": np.full((*t.after.time.shape, 1), -0.02),
        }

    def terminated(self, t: Transition) -> Array:
        return self.success(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: The paddle has passed all goals in order."""
        return np.asarray(t.new_memory["passed"] >= self.count)

    def targets(self, memory: Memory) -> Array | None:
        return memory["goals"]

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        goals, passed = memory["goals"], memory["passed"]
        return [
            Mark.circle(goals[..., k, :], self.radius, shown=passed <= k)
            for k in range(self.count)
        ]

    def caption(self, memory: Memory) -> Caption:
        return Caption("goal {:.0f} of {:.0f}", memory["passed"], self.count)


make = ReachSequence
