"""Strike a resting puck into a triangle of fifteen blocks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar, Literal

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    Memory,
    Metres,
    RandomStreams,
    Scenario,
    Scene,
    Seconds,
    State,
    Transition,
    length,
    observables,
    rewards,
    starts,
)

ROWS = 5
GAP = 0.004
"""Distance between neighbouring blocks of the triangle, m."""


@dataclass(frozen=True, kw_only=True)
class StrikeCrowd(Scenario):
    """Task of striking a resting puck into a triangle of fifteen blocks.

    The blocks must be displaced by ``spread`` in total, on a level table.

    Start:
        The paddle is near the home end and the puck rests in front of it. The triangle
        of blocks is in the far half, up to 0.1 m from the middle.

    Termination:
        Success.
    """

    title: ClassVar[str] = "Break the triangle"
    seconds: Seconds = 7.5
    spread: Metres = 0.08
    """Sum of displacements for a success, m. A shot at 1.04 m/s gives 0.10 to 0.12."""
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

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = self.scene.still_state(worlds)
        box = partial(starts.uniform_box, rng, self.scene.table)
        state.paddle[:, 0] = box((-0.74, -0.64), starts.PADDLE_Y)
        state.puck[:, 0] = box((-0.49, -0.32), (-0.10, 0.10))
        pitch = 2 * self.scene.block_radius + GAP
        lift = 0.87 * pitch if self.shape == "disc" else pitch
        apex = self.scene.table.from_standard(np.array([(0.25, -0.10), (0.25, 0.10)]))
        triangle = np.array(
            [
                (apex[0, 0] + row * lift, (k - 0.5 * row) * pitch)
                for row in range(ROWS)
                for k in range(row + 1)
            ]
        )
        middle = rng.uniform(*apex[:, 1])
        state.block[:] = triangle
        state.block[..., 1] += middle[:, None]
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "gap": starts.puck_gap(state),
            "origin": state.block.copy(),
            "spread": np.zeros(worlds),
            "rise": np.zeros(worlds),
        }

    def update_memory(self, t: Transition) -> Memory:
        spread = length(t.after.block - t.memory["origin"]).sum(-1)
        rise = t.after.puck_velocity[..., 0, 0] * rewards.touched(t.new_memory)
        return {
            "gap": rewards.nearest(t),
            "spread": np.maximum(t.memory["spread"], spread),
            "rise": np.maximum(t.memory["rise"], rise),
        }

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
        observables.Blocks(0.35),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        rise: 0.5 times the increase of the highest upward speed of the touched puck so
        far, m/s.
        spread: 4 times the increase of the largest sum of displacements of the blocks
        so far, m.
        time: -0.01 in each step.
        success: 3, once.
        """
        return {
            "approach": rewards.approach(t),
            "rise": 0.5 * (t.new_memory["rise"] - t.memory["rise"])[..., None],
            "spread": 4.0 * (t.new_memory["spread"] - t.memory["spread"])[..., None],
            "time": np.full((*t.after.time.shape, 1), -0.01),
            "success": 3.0 * self.success(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return self.success(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: The blocks have been displaced by ``spread`` in total."""
        return np.asarray(t.new_memory["spread"] >= self.spread)

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: After 0.15 s, displacements sum to a tenth of the diagonal."""
        spread = length(t.after.block - t.memory["origin"]).sum(-1)
        tenth = 0.1 * length(self.table_geometry.size)
        return np.asarray((spread > tenth) & (t.after.time > 0.15))

    def caption(self, memory: Memory) -> Caption:
        numbers = 100 * memory["spread"], 100 * self.spread
        return Caption("blocks moved {:.1f} of {:.0f} cm", *numbers)


make = StrikeCrowd
