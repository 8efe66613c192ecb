"""Hit the falling puck so that it moves a block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.geometry import length
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory


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
    def scene(self) -> Scene:
        return Scene(
            self.table_geometry,
            (self.seat(),),
            pucks=1,
            blocks=1,
            block_shape=self.shape,
            goal_lines=(GoalLine("home", 0),),
        )

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)

        def sample(some: RandomStreams) -> Array:
            return starts.place(some, (0.05, 0.70), (-0.229, 0.229))

        def aside(rows: Array) -> Array:
            # The puck must not fall onto the block.
            return np.asarray(np.abs(rows[:, 1] - state.puck[:, 0, 1]) >= 0.09)

        state.block[:, 0] = starts.redraw(rng, sample, aside)
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "origin": state.block[:, 0].copy(),
            "near": np.full(worlds, np.inf),
            "moved": np.zeros(worlds),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
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
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.Blocks(0.4),
        observables.PuckToBlocks(),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
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
