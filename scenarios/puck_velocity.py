"""Hit a falling puck back with a high speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import (
    Array,
    Caption,
    Memory,
    RandomStreams,
    Seconds,
    Speed,
    State,
    Transition,
    rewards,
)
from marl_airhockey.toolkit.falling import FallingPuck


@dataclass(frozen=True, kw_only=True)
class PuckVelocity(FallingPuck):
    """Task of hitting a falling puck back with a high speed.

    Start:
        The paddle is near the home end. The puck falls from the far half.

    Termination:
        Success, or the puck crosses the home line.
    """

    title: ClassVar[str] = "Hit it back fast"
    seconds: Seconds = 5.0
    fast: Speed = 1.2
    """Upward speed of the puck for a success, m/s."""

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        return {
            **super().initial_memory(state, rng),
            "rise": np.zeros(len(rng)),
        }

    def update_memory(self, t: Transition) -> Memory:
        rise = t.after.puck_velocity[..., 0, 0] * rewards.touched(t.new_memory)
        return {
            "gap": rewards.nearest(t),
            "rise": np.maximum(t.memory["rise"], rise),
        }

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        rise: Increase of the highest upward speed of the touched puck so far, m/s.
        success: 2, once.
        drop: -1 when the puck crosses the home line.
        """
        return {
            "approach": rewards.approach(t),
            "rise": (t.new_memory["rise"] - t.memory["rise"])[..., None],
            "success": 2.0 * self.success(t)[..., None],
            "drop": -1.0 * rewards.lost(t)[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return self.success(t) | rewards.lost(t)

    def success(self, t: Transition) -> Array:
        """(...) bool: The puck has risen at ``fast`` after a touch."""
        return np.asarray(t.new_memory["rise"] >= self.fast)

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: After 1.25 s, the puck is 0.5 m above the centre line."""
        high = t.after.puck[..., 0, 0] > 0.5
        return np.asarray(high & (t.after.time > 1.25))

    def caption(self, memory: Memory) -> Caption:
        rise = np.maximum(memory["rise"], 0.0)
        return Caption("speed {:.2f} of {:.2f} m/s", rise, self.fast)


make = PuckVelocity
