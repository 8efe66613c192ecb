"""Two players juggle a puck in alternation."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
    Seat,
    Seconds,
    State,
    Transition,
    Weight,
    clip,
    observables,
    rewards,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class TeamJuggle(Scenario):
    """Game in which two players juggle a puck in alternation.

    A hit that raises the puck by ``lift`` rewards both players, if the other player
    made the last such hit. The players are side by side at the home end, each with its
    own half of the width.

    Start:
        The paddles are near the home end. The puck falls from the far half.

    Termination:
        A puck crosses the home line.
    """

    title: ClassVar[str] = "Juggle together"
    seconds: Seconds = 30.0
    pucks: Pucks = 1
    """Number of pucks."""
    lift: Metres = 0.2
    """Height by which a hit must raise the puck's centre, m."""
    passes: int = 8
    """Number of rewarded hits for a success."""
    gap: Metres = 0.10
    """Distance between the workspaces of the players, m."""
    lift_weight: Weight = 0.0
    """Additional reward of both players for any hit that raises a puck by ``lift``."""

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        seats = self._half(1.0), self._half(-1.0)
        return Scene(self.table_geometry, seats, pucks=self.pucks, goal_lines=(home,))

    def _half(self, side: float) -> Seat:
        seat = self.seat()
        normal = np.array([0.0, side])
        half = clip(np.asarray(seat.reach), normal, -self.gap / 2)
        return replace(seat, reach=tuple((float(x), float(y)) for x, y in half))

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        homes = np.array([(-0.65, 0.15), (-0.65, -0.15)])
        state.paddle[:] = self.scene.table.from_standard(homes)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        nobody = np.zeros((len(rng), self.pucks))
        return {
            **super().initial_memory(state, rng),
            **rewards.no_lifts(state),
            "striker": nobody,
            "passer": nobody.copy(),
            "passes": np.zeros(len(rng)),
            "lifted": np.zeros(len(rng)),
        }

    def update_memory(self, t: Transition) -> Memory:
        lifts, risen = rewards.lifts(t, self.lift)
        striker = rewards.last_toucher(t.memory["striker"], t.after)
        passer = t.memory["passer"]
        passed = risen & (passer > 0) & (passer != striker)
        return {
            **lifts,
            "striker": striker,
            "passer": np.where(risen, striker, passer),
            "passes": t.memory["passes"] + passed.sum(-1),
            "lifted": t.memory["lifted"] + risen.sum(-1),
        }

    observation = (
        observables.OwnPaddle(),
        observables.OtherPaddles(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.FromMemory("armed", 0.0, 1.0, 1.0),
        observables.FromMemory("struck_at", -1.0, 1.0, 1.0, from_own=True),
        observables.IsThisSeat("striker"),
        observables.IsThisSeat("passer"),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        pass: 1 for both players when one raises a puck that the other raised last.
        lift: ``lift_weight`` for both players for any hit that raises a puck.
        """
        passed = t.new_memory["passes"] - t.memory["passes"]
        terms = {"pass": passed[..., None] * np.ones(2)}
        if self.lift_weight:
            lifted = t.new_memory["lifted"] - t.memory["lifted"]
            terms["lift"] = self.lift_weight * lifted[..., None] * np.ones(2)
        return terms

    def terminated(self, t: Transition) -> Array:
        return rewards.lost(t)

    def scores(self, memory: Memory) -> dict[str, Array]:
        return {"passes": memory["passes"][..., None]}

    def success(self, t: Transition) -> Array:
        """(...) bool: There have been ``passes`` hits in alternation."""
        return np.asarray(t.new_memory["passes"] >= self.passes)

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        heights, armed = memory["struck_at"] + self.lift, memory["armed"] > 0
        return [
            Mark.across(self.table_geometry, heights[..., k], armed[..., k])
            for k in range(self.pucks)
        ]

    def caption(self, memory: Memory) -> Caption:
        return Caption("passes {:.0f} of {:.0f}", memory["passes"], self.passes)


make = TeamJuggle
