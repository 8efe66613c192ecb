"""Touch a falling puck, as often as possible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Memory,
    Seconds,
    Transition,
    length,
    rewards,
)
from marl_airhockey.toolkit.falling import FallingPuck


@dataclass(frozen=True, kw_only=True)
class Touch(FallingPuck):
    """Task of touching a falling puck, as often as possible.

    Start:
        The paddle is near the home end. The puck falls from the far half.

    Termination:
        The puck crosses the home line.
    """

    title: ClassVar[str] = "Touch the puck"
    seconds: Seconds = 5.0

    def update_memory(self, t: Transition) -> Memory:
        return {"gap": rewards.nearest(t)}

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        touch: 1 for each distinct touch.
        drop: -1 when the puck crosses the home line.
        """
        return {
            "approach": rewards.approach(t),
            "touch": 1.0 * (t.new_memory["touches"] - t.memory["touches"]).sum(-1),
            "drop": -1.0 * rewards.lost(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return rewards.lost(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: A distinct touch has happened."""
        return rewards.touched(t.new_memory)

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: Paddle and puck are within 0.02 m of a touch."""
        gap = length(t.after.puck[..., 0, :] - t.after.paddle[..., 0, :])
        table = self.table_geometry
        return np.asarray(gap < table.paddle_radius + table.puck_radius + 0.02)


make = Touch
