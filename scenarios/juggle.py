"""Keep the puck up: hit it again and again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Juggle(Scenario):
    """A hit pays 1 once the puck has risen ``lift`` above where it was hit.

    A carried or cradled puck never rises above its last contact and earns nothing;
    losing a puck at home ends the episode and costs 2.
    """

    seconds: float = 15.0
    pucks: int = 1
    """Number of pucks, 1 or 2."""
    lift: float = 0.2
    """m: how far a hit must raise the puck's centre."""
    hits: int = 4
    """Hits that make a success."""

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        seats = (self.seat(),)
        return Scene(self.table_geometry, seats, pucks=self.pucks, goal_lines=(home,))

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        return starts.falling(rng, self.scene), {
            **rewards.no_touches(worlds, 1, self.pucks),
            **rewards.no_lifts(worlds, self.pucks),
            "hits": np.zeros(worlds),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        lifts, risen = rewards.lifts(memory, before, after, self.lift)
        return {**lifts, "hits": memory["hits"] + risen.sum(-1)}

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.FromMemory("armed", 0.0, 1.0, 1.0),
        observables.FromMemory("struck_at", -1.0, 1.0, 1.0, from_own=True),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "hit": (new["hits"] - old["hits"])[..., None],
            "drop": -2.0 * self.terminated(after, new)[..., None],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return np.asarray(after.crossed[..., 0].any(-1))

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["hits"] >= self.hits)

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        armed = memory["struck_at"][memory["armed"] > 0]
        return [Mark.across(self.table_geometry, x + self.lift) for x in armed]


make = Juggle
