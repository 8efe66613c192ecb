"""Strike a resting puck into a triangle of fifteen blocks and spread them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.geometry import length
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts
from marl_airhockey.types import Array, Memory

ROWS = 5
GAP = 0.004
"""m between two blocks of the triangle."""


@dataclass(frozen=True, kw_only=True)
class StrikeCrowd(Scenario):
    """The summed displacement of the blocks is rewarded, best so far, by the metre.

    Going to the puck and its best upward speed after a touch show the way there.
    """

    seconds: float = 7.5
    spread: float = 0.30
    """m: wanted sum of displacements."""
    shape: Literal["disc", "square"] = "disc"
    """Shape of the blocks."""

    @cached_property
    def scene(self) -> Scene:
        return Scene(
            self.table_geometry,
            (self.seat(),),
            pucks=1,
            blocks=ROWS * (ROWS + 1) // 2,
            block_radius=0.0277,
            block_shape=self.shape,
            physics={"tilt": 0.0, "block_friction": 0.5},
        )

    def start(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.first_state(self.scene, worlds)
        state.position[:, 0] = starts.place(rng, (-0.74, -0.64), starts.PADDLE_Y)
        state.position[:, 1] = starts.place(rng, (-0.49, -0.32), (-0.10, 0.10))
        pitch = 2 * self.scene.block_radius + GAP
        lift = 0.87 * pitch if self.shape == "disc" else pitch
        triangle = np.array(
            [
                (0.25 + row * lift, (k - 0.5 * row) * pitch)
                for row in range(ROWS)
                for k in range(row + 1)
            ]
        )
        middle = rng.uniform(-0.10, 0.10)
        state.block[:] = triangle
        state.block[..., 1] += middle[:, None]
        return state, {
            **rewards.no_touches(worlds, 1, 1),
            "gap": starts.puck_gap(state),
            "origin": state.block.copy(),
            "spread": np.zeros(worlds),
            "rise": np.zeros(worlds),
        }

    def update_memory(
        self, memory: Memory, before: State, command: Array, after: State
    ) -> Memory:
        spread = length(after.block - memory["origin"]).sum(-1)
        rise = after.puck_velocity[..., 0, 0] * rewards.touched(memory)
        return {
            "gap": rewards.nearest(memory, after),
            "spread": np.maximum(memory["spread"], spread),
            "rise": np.maximum(memory["rise"], rise),
        }

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.Blocks(0.35),
    )

    def reward_terms(
        self, before: State, command: Array, after: State, old: Memory, new: Memory
    ) -> dict[str, Array]:
        return {
            "approach": (old["gap"] - new["gap"])[..., None],
            "rise": 0.5 * (new["rise"] - old["rise"])[..., None],
            "spread": 4.0 * (new["spread"] - old["spread"])[..., None],
            "time": np.full((*after.time.shape, 1), -0.01),
            "success": 3.0 * self.success(after, new)[..., None],
        }

    def terminated(self, after: State, memory: Memory) -> Array:
        return self.success(after, memory)

    def success(self, after: State, memory: Memory) -> Array:
        return np.asarray(memory["spread"] >= self.spread)


make = StrikeCrowd
