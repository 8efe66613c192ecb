"""Hit a falling puck up again and again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    GoalLine,
    Mark,
    Memory,
    Metres,
    Pucks,
    RandomStreams,
    Scenario,
    Scene,
    Seconds,
    State,
    Transition,
    observables,
    rewards,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class Juggle(Scenario):
    """Task of hitting a falling puck up again and again.

    A hit counts when the puck has risen ``lift`` above the point of contact. A puck
    that is carried never rises above its last contact and gives no reward.

    Start:
        The paddle is near the home end. The puck falls from the far half.

    Termination:
        The puck crosses the home line.
    """

    title: ClassVar[str] = "Juggle"
    seconds: Seconds = 15.0
    pucks: Pucks = 1
    """Number of pucks."""
    lift: Metres = 0.3
    """Height by which a hit must raise the puck's centre, m."""
    hits: int = 4
    """Number of hits for a success."""

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        seats = (self.seat(),)
        return Scene(self.table_geometry, seats, pucks=self.pucks, goal_lines=(home,))

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        return {
            **super().initial_memory(state, rng),
            **rewards.no_lifts(state),
            "hits": np.zeros(len(rng)),
        }

    def update_memory(self, t: Transition) -> Memory:
        lifts, risen = rewards.lifts(t, self.lift)
        return {**lifts, "hits": t.memory["hits"] + risen.sum(-1)}

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.FromMemory("armed", 0.0, 1.0, 1.0),
        observables.FromMemory("struck_at", -1.0, 1.0, 1.0, from_own=True),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        hit: 1 for each hit that raises the puck by ``lift``.
        drop: -2 when the puck crosses the home line.
        """
        return {
            "hit": (t.new_memory["hits"] - t.memory["hits"])[..., None],
            "drop": -2.0 * self.terminated(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return rewards.lost(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: The puck has been hit up ``hits`` times."""
        return np.asarray(t.new_memory["hits"] >= self.hits)

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: After 2.5 s, a puck is in the near quarter of the far half.

        The paddle must be four paddle radii behind the centre line.
        """
        half = self.table_geometry.size[0] / 2
        x, paddle = t.after.puck[..., 0], t.after.paddle[..., 0, 0]
        inside = ((x > 0) & (x < half / 4)).any(-1)
        back = paddle < -4 * self.table_geometry.paddle_radius
        return np.asarray(inside & back & (t.after.time > 2.5))

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        heights, armed = memory["struck_at"] + self.lift, memory["armed"] > 0
        return [
            Mark.across(self.table_geometry, heights[..., k], armed[..., k])
            for k in range(self.pucks)
        ]

    def caption(self, memory: Memory) -> Caption:
        return Caption("hits {:.0f} of {:.0f}", memory["hits"], self.hits)


make = Juggle
