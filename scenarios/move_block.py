"""Strike a falling puck so that it moves a block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    GoalLine,
    Memory,
    Metres,
    RandomStreams,
    Scene,
    Seconds,
    State,
    Transition,
    length,
    observables,
    rewards,
    starts,
)
from marl_airhockey.toolkit.falling import FewShots


@dataclass(frozen=True, kw_only=True)
class MoveBlock(FewShots):
    """Task of striking a falling puck so that it moves a block.

    Only a puck that was touched and rises counts, because a falling puck meets the
    block by chance. One of the first ``shots`` touches must move the block by ``way``.

    Start:
        The paddle is near the home end. The puck falls from the far half. The block
        rests in the far half, at least 0.09 m to the side of the puck.

    Termination:
        Success, a touch after the last shot, or the puck crosses the home line.
    """

    title: ClassVar[str] = "Move the block"
    version: ClassVar[int] = 1
    seconds: Seconds = 10.0
    way: Metres = 0.04
    """Displacement of the block by a shot for a success, m."""
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

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state, table = starts.falling(rng, self.scene), self.scene.table

        def sample(some: RandomStreams) -> Array:
            return starts.uniform_box(some, table, (0.05, 0.40), (-0.229, 0.229))

        def aside(rows: Array) -> Array:
            # The puck must not fall onto the block.
            return np.asarray(np.abs(rows[:, 1] - state.puck[:, 0, 1]) >= 0.09)

        state.block[:, 0] = starts.redraw(rng, sample, aside)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "origin": state.block[:, 0].copy(),
            "pushed": np.zeros(worlds, np.bool_),
            "near": np.full(worlds, np.inf),
            "moved": np.zeros(worlds),
        }

    def update_memory(self, t: Transition) -> Memory:
        touched, block = rewards.touched(t.new_memory), t.after.block[..., 0, :]
        speed, old_speed = (
            length(x.block_velocity[..., 0, :]) for x in (t.after, t.before)
        )
        hit = speed > old_speed + 1e-6
        struck = (t.after.touched > 0).any((-1, -2))
        rising = touched & ((t.before.puck_velocity[..., 0, 0] > 0) | struck)
        fair = hit & rising & self.within_shots(t.new_memory)
        # A displacement by a falling puck does not count: it moves the origin.
        pushed = np.where(hit, fair, t.memory["pushed"])
        begins = fair & ~t.memory["pushed"]
        here = np.where(begins[..., None], t.before.block[..., 0, :], block)
        keeps = pushed & ~begins
        origin = np.where(keeps[..., None], t.memory["origin"], here)
        moved = length(block - origin) * pushed
        near = np.minimum(t.memory["near"], length(t.after.puck[..., 0, :] - block))
        return {
            "gap": rewards.nearest(t),
            "origin": origin,
            "pushed": pushed,
            "near": np.where(touched, near, np.inf),
            "moved": np.maximum(t.memory["moved"], moved),
        }

    observation = (
        *FewShots.observation,
        observables.Blocks(0.4),
        observables.PuckToBlocks(),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        aim: 2 times the decrease of the shortest distance between the struck puck and
        the block so far, m.
        moved: 10 times the increase of the largest displacement by a shot so far, m.
        success: 3, once.
        drop: -1 when the puck crosses the home line.
        """
        return {
            "approach": rewards.approach(t),
            "aim": 2.0
            * rewards.gained(t.memory["near"], t.new_memory["near"])[..., None],
            "moved": 10.0 * (t.new_memory["moved"] - t.memory["moved"])[..., None],
            "success": 3.0 * self.success(t)[..., None],
            "drop": -1.0 * rewards.lost(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        over = rewards.lost(t) | ~self.within_shots(t.new_memory)
        return np.asarray(self.success(t) | over)

    def success(self, t: Transition) -> Array:
        """(...) bool: A shot has displaced the block by ``way``."""
        return np.asarray(t.new_memory["moved"] >= self.way)

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: After 0.25 s, the block moves by a 5000th of the diagonal.

        It must move so far in one step. The published code measures the displacement
        since the start. The cause does not matter.
        """
        least = length(self.table_geometry.size) / 5000
        moved = length(t.after.block[..., 0, :] - t.before.block[..., 0, :]) > least
        return np.asarray(moved & (t.after.time > 0.25))

    def caption(self, memory: Memory) -> Caption:
        numbers = 100 * memory["moved"], 100 * self.way
        return Caption("block moved {:.1f} of {:.0f} cm", *numbers)


make = MoveBlock
