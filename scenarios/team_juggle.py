"""Keep pucks up together, striking in turn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.geometry import clip
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.core.seat import Seat
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class TeamJuggle(Scenario):
    """A hit that raises a puck by ``lift`` pays both 1 if the other made the last one.

    The seats stand side by side at home, each with its own half of the width; a puck
    that reaches home ends the episode.
    """

    seconds: float = 30.0
    pucks: int = 1
    """Pucks to be kept up at once."""
    lift: float = 0.2
    """m: how far a hit must raise the puck's centre."""
    passes: int = 8
    """Paid hits that make a success."""
    gap: float = 0.10
    """m between the reaches of the seats."""

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

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        state.paddle[:] = [(-0.65, 0.15), (-0.65, -0.15)]
        return state, {
            **rewards.no_touches(worlds, 2, self.pucks),
            **rewards.no_lifts(worlds, self.pucks),
            "striker": np.zeros((worlds, self.pucks)),
            "passer": np.zeros((worlds, self.pucks)),
            "passes": np.zeros(worlds),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        lifts, risen = rewards.lifts(memory, before, after, self.lift)
        striker = rewards.last_toucher(memory["striker"], after)
        passer = memory["passer"]
        passed = risen & (passer > 0) & (passer != striker)
        return {
            **lifts,
            "striker": striker,
            "passer": np.where(risen, striker, passer),
            "passes": memory["passes"] + passed.sum(-1),
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

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        passed = new["passes"] - old["passes"]
        return {"pass": passed[..., None] * np.ones(2)}

    def terminated(self, after: State, memory: Memory) -> Array:
        return np.asarray(after.crossed[..., 0].any(-1))

    def caption(self, memory: Memory) -> str:
        return f"passes {memory['passes']:.0f}"

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["passes"] >= self.passes)

    def marks(self, state: State, memory: Memory) -> list[Mark]:
        armed = memory["struck_at"][memory["armed"] > 0]
        return [Mark.across(self.table_geometry, x + self.lift) for x in armed]


make = TeamJuggle
