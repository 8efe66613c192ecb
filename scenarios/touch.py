"""Touch the falling puck, as often as it comes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from marl_airhockey import rewards, starts, views
from marl_airhockey.cast import Cast, Mouth
from marl_airhockey.draws import Draws
from marl_airhockey.scenario import Scenario
from marl_airhockey.state import Array, Memory, State


@dataclass(frozen=True, kw_only=True)
class Touch(Scenario):
    """Every distinct touch pays 1; losing the puck at home costs 1.

    Going to the puck before the first touch is rewarded by the metre.
    """

    seconds: float = 5.0

    @cached_property
    def cast(self) -> Cast:
        home = Mouth("home", 0)
        return Cast(self.table_geometry, (self.seat(),), pucks=1, mouths=(home,))

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(draws, self.cast)
        memory = rewards.no_touches(worlds, 1, 1)
        return state, {**memory, "gap": starts.puck_gap(state)}

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        return {"gap": rewards.nearest(memory, after)}

    observation = (views.Own(), views.Pucks(), views.PucksFromOwn(), views.Touched())

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "approach": (old["gap"] - new["gap"])[..., None],
            "touch": 1.0 * (new["touches"] - old["touches"]).sum(-1),
            "drop": -1.0 * after.crossed[..., 0, :1],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return after.crossed[..., 0, 0]

    def success(self, after: State, memory: Memory) -> Array:
        return rewards.touched(memory)


make = Touch
