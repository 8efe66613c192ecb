"""Touch the falling puck, as often as it comes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class Touch(Scenario):
    """Every distinct touch pays 1; losing the puck at home costs 1.

    Going to the puck before the first touch is rewarded by the metre.
    """

    seconds: float = 5.0

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        return Scene(self.table_geometry, (self.seat(),), pucks=1, goal_lines=(home,))

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        memory = rewards.no_touches(worlds, 1, 1)
        return state, {**memory, "gap": starts.puck_gap(state)}

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        return {"gap": rewards.nearest(memory, after)}

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
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
