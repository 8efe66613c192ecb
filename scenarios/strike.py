"""Strike a resting puck so that it leaves fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar

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
    Speed,
    State,
    Transition,
    length,
    observables,
    rewards,
    starts,
)


@dataclass(frozen=True, kw_only=True)
class Strike(Scenario):
    """Task of striking a resting puck so that it leaves fast, on a level table.

    Success requires speed and distance in the same step, so that pushing the puck does
    not succeed. A paddle of 0.7 m/s gives a resting puck at most 1.05 m/s.

    Start:
        The paddle is near the home end and the puck rests in front of it.

    Termination:
        Success.
    """

    title: ClassVar[str] = "Strike the puck"
    seconds: Seconds = 2.0
    fast: Speed = 0.8
    """Speed of the puck for a success, m/s."""
    distance: Metres = 0.3
    """Distance of the puck from its start for a success, m."""

    @cached_property
    def scene(self) -> Scene:
        flat = {"tilt": 0.0}
        return Scene(self.table_geometry, (self.seat(),), pucks=1, physics=flat)

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = self.scene.still_state(worlds)
        box = partial(starts.uniform_box, rng, self.scene.table)
        state.paddle[:, 0] = box((-0.74, -0.64), starts.PADDLE_Y)
        state.puck[:, 0] = box((-0.49, -0.32), (-0.20, 0.20))
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        worlds = len(rng)
        return {
            **super().initial_memory(state, rng),
            "gap": starts.puck_gap(state),
            "origin": state.puck[:, 0].copy(),
            "speed": np.zeros(worlds),
            "struck": np.zeros(worlds, np.bool_),
        }

    def update_memory(self, t: Transition) -> Memory:
        speed = length(t.after.puck_velocity[..., 0, :])
        away = length(t.after.puck[..., 0, :] - t.memory["origin"]) >= self.distance
        return {
            "gap": rewards.nearest(t),
            "speed": np.maximum(t.memory["speed"], speed),
            "struck": t.memory["struck"] | (away & (speed >= self.fast)),
        }

    observation = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
    )

    def reward_terms(self, t: Transition) -> dict[str, Array]:
        """Return the reward terms.

        approach: Decrease of the shortest distance between paddle and puck so far, m.
        speed: Increase of the highest speed of the puck so far, m/s.
        time: -0.01 in each step.
        success: 2, once.
        """
        return {
            "approach": rewards.approach(t),
            "speed": (t.new_memory["speed"] - t.memory["speed"])[..., None],
            "time": np.full((*t.after.time.shape, 1), -0.01),
            "success": 2.0 * (t.new_memory["struck"] & ~t.memory["struck"])[..., None],
        }

    def terminated(self, t: Transition) -> Array:
        return t.new_memory["struck"]

    def success(self, t: Transition) -> Array:
        """(...) bool: The puck was fast and far from its start in the same step."""
        return t.new_memory["struck"]

    def paper_success(self, t: Transition) -> Array:
        """(...) bool: The puck is faster than 0.2 m/s."""
        return np.asarray(length(t.after.puck_velocity[..., 0, :]) > 0.2)

    def caption(self, memory: Memory) -> Caption:
        return Caption("speed {:.2f} of {:.2f} m/s", memory["speed"], self.fast)


make = Strike
