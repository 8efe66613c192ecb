"""Hit the falling puck so that it moves a block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from marl_airhockey import rewards, starts, views
from marl_airhockey.cast import Cast, Mouth
from marl_airhockey.draws import Draws
from marl_airhockey.rewards import length
from marl_airhockey.scenario import Scenario
from marl_airhockey.state import Array, Memory, State


@dataclass(frozen=True, kw_only=True)
class MoveBlock(Scenario):
    """Way of the block since the first touch is rewarded by the metre, best so far.

    Going to the puck, and after that the puck's nearing the block, show the way there.
    """

    seconds: float = 10.0
    way: float = 0.05
    """m: how far the block must be moved from where it stood at the first touch."""
    shape: Literal["disc", "square"] = "disc"
    """Shape of the block."""

    @cached_property
    def cast(self) -> Cast:
        return Cast(
            self.table_geometry,
            (self.seat(),),
            pucks=1,
            blocks=1,
            block_shape=self.shape,
            mouths=(Mouth("home", 0),),
        )

    def start(self, draws: Draws, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(draws, self.cast)

        def sample(some: Draws) -> Array:
            return starts.place(some, (0.05, 0.70), (-0.229, 0.229))

        def aside(rows: Array) -> Array:
            # The puck must not fall onto the block.
            return np.asarray(np.abs(rows[:, 1] - state.puck[:, 0, 1]) >= 0.09)

        state.block[:, 0] = starts.redraw(draws, sample, aside)
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "origin": state.block[:, 0].copy(),
            "near": np.full(worlds, np.inf),
            "moved": np.zeros(worlds),
        }

    def remember(
        self, memory: Memory, before: State, sent: Array, after: State
    ) -> Memory:
        touched, block = rewards.touched(memory), after.block[..., 0, :]
        fresh = touched & np.isinf(memory["near"])
        origin = np.where(
            (fresh | ~touched)[..., None], before.block[..., 0, :], memory["origin"]
        )
        near = np.minimum(memory["near"], length(after.puck[..., 0, :] - block))
        moved = length(block - origin) * touched
        return {
            "gap": rewards.nearest(memory, after),
            "origin": origin,
            "near": np.where(touched, near, np.inf),
            "moved": np.maximum(memory["moved"], moved),
        }

    observation = (
        views.Own(),
        views.Pucks(),
        views.PucksFromOwn(),
        views.Touched(),
        views.Blocks(0.4),
        views.BlocksFromPuck(),
    )

    def reward_terms(
        self, before: State, sent: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "approach": (old["gap"] - new["gap"])[..., None],
            "aim": 2.0 * rewards.gained(old["near"], new["near"])[..., None],
            "moved": 10.0 * (new["moved"] - old["moved"])[..., None],
            "success": 3.0 * self.success(after, new)[..., None],
            "drop": -1.0 * after.crossed[..., 0, :1],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return self.success(after, memory) | after.crossed[..., 0, 0]

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["moved"] >= self.way)


make = MoveBlock
