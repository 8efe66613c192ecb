"""Strike the puck so that it comes off three banks, and touch it again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from marl_airhockey.toolkit import (
    Array,
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

# Arrays are (..., *): the axes on the left belong to the caller, who may have one world
# or thousands, or a recording. Write `[..., 0]` instead of `[:, 0]`, and `np.where`
# instead of `if`, so that the rules can be compiled. Positions are in metres, in the
# table frame: its origin is the middle of the table, x points to the far end, y left.


@dataclass(frozen=True, kw_only=True)
class Template(Scenario):
    """Task that pays for each bank after a strike, and most for the touch at the end.

    A touch before the last bank begins the count anew. Say here what is rewarded, and
    why it cannot be had otherwise.
    """

    # The fields are the options of the task, `--option banks=2`. A sentence behind each
    # says what it means; `airhockey list` shows it.
    seconds: float = 8.0
    """Length of an episode (s)."""
    banks: int = 3
    """Number of banks between two touches."""

    @cached_property
    def scene(self) -> Scene:
        # Who is on the table: one seat, as a UR5e could hold it, and a puck. A goal is
        # a `GoalLine`; physical parameters that differ from the table's are named here.
        return Scene(
            self.table_geometry, (self.seat(),), pucks=1, physics={"tilt": 0.0}
        )

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        # A first state and memory for each world, drawn from `rng` and nothing else.
        # Bodies are sorted by kind: paddles, then pucks.
        state = self.scene.still_state(worlds)
        box = partial(starts.uniform_box, rng, self.scene.table)
        state.paddle[:, 0] = box((-0.74, -0.64), starts.PADDLE_Y)
        state.puck[:, 0] = box((-0.49, -0.32), (-0.20, 0.20))
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        # What the rules must know of the past. Touches are kept for every scenario.
        # `FromMemory`, below, shows what has a number for each puck.
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "gap": starts.puck_gap(state),
            "banks": np.zeros((worlds, 1)),
            "done": np.zeros(worlds, np.bool_),
        }

    def update_memory(self, t: Transition) -> Memory:
        # What changes by a step: `t.before`, `t.after`, `t.memory`, and `t.new_memory`
        # with the new touches.
        struck = rewards.touched(t.memory)
        touch = (t.new_memory["touches"] > t.memory["touches"]).any(-2)
        banks = t.memory["banks"] + struck[..., None] * t.after.banked.sum(-1)
        return {
            "gap": rewards.nearest(t),
            "banks": np.where(touch, 0.0, banks),
            "done": t.memory["done"] | (touch & (banks >= self.banks)).any(-1),
        }

    # What a seat is shown; bounds, names and scaling follow from it.
    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.FromMemory("banks", 0.0, 10.0, 3.0),
    )

    # Terms by name, each (..., seats); their sum is the reward. `airhockey list` shows
    # what the docstring says of each.
    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the terms.

        approach: metres by which the paddle came nearer to the puck than before.
        bank: 0.2 for each bank that counts.
        success: 3 once.
        """
        counted = np.minimum(t.new_memory["banks"], self.banks)
        fresh = counted - np.minimum(t.memory["banks"], self.banks)
        return {
            "approach": (t.memory["gap"] - t.new_memory["gap"])[..., None],
            "bank": 0.2 * np.maximum(fresh, 0.0),
            "success": 3.0 * (t.new_memory["done"] & ~t.memory["done"])[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return t.new_memory["done"]

    def success(self, t: Transition) -> Array:
        """(...) bool: the bank shot was struck."""
        # It must be out of reach of luck: `airhockey evaluate still` and `random` tell.
        return t.new_memory["done"]


make = Template
