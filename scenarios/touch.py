"""Touch the falling puck, as often as it comes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from marl_airhockey.toolkit import (
    Array,
    GoalLine,
    Memory,
    RandomStreams,
    Scenario,
    Scene,
    State,
    Transition,
    observables,
    rewards,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class Touch(Scenario):
    """Task in which every distinct touch pays 1; losing the puck at home costs 1.

    Approaching the puck before the first touch is rewarded per metre.
    """

    seconds: float = 5.0

    @cached_property
    def scene(self) -> Scene:
        home = GoalLine("home", 0)
        return Scene(self.table_geometry, (self.seat(),), pucks=1, goal_lines=(home,))

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        touches = super().initial_memory(state, rng)
        return {**touches, "gap": starts.puck_gap(state)}

    def update_memory(self, t: Transition) -> Memory:
        return {"gap": rewards.nearest(t)}

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the terms.

        approach: metres by which the paddle came nearer to the puck than before.
        touch: 1 for each distinct touch.
        drop: -1 when the puck passes the home line.
        """
        return {
            "approach": rewards.approach(t),
            "touch": 1.0 * (t.new_memory["touches"] - t.memory["touches"]).sum(-1),
            "drop": -1.0 * rewards.lost(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return rewards.lost(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: any distinct touch."""
        return rewards.touched(t.new_memory)


make = Touch
