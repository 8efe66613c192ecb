"""Keep the puck up: hit it again and again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey import rewards, starts, views
from marl_airhockey.cast import Cast, Mouth
from marl_airhockey.draws import Draws
from marl_airhockey.scenario import Mark, Scenario
from marl_airhockey.state import Array, Memory, State


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
    def cast(self) -> Cast:
        home = Mouth("home", 0)
        seats = (self.seat(),)
        return Cast(self.table_geometry, seats, pucks=self.pucks, mouths=(home,))

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        return starts.falling(draws, self.cast), {
            **rewards.no_touches(worlds, 1, self.pucks),
            **rewards.no_lifts(worlds, self.pucks),
            "hits": np.zeros(worlds),
        }

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        lifts, risen = rewards.lifts(memory, before, after, self.lift)
        return {**lifts, "hits": memory["hits"] + risen.sum(-1)}

    observation = (
        views.Own(),
        views.Pucks(),
        views.PucksFromOwn(),
        views.Recall("armed", 0.0, 1.0, 1.0),
        views.Recall("struck_at", -1.0, 1.0, 1.0, from_own=True),
    )

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
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
