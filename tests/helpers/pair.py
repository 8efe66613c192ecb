"""A two-seat game for the tests: shows what games need of the core.

Seats face each other, a goal serves the puck again inside the episode.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.toolkit import (
    GoalLine,
    Scenario,
    Scene,
    observables,
)


@dataclass(frozen=True, kw_only=True)
class Pair(Scenario):
    seats: str = "arcade"
    seconds: float = 10.0
    jitter_weight: float = 0.0

    @cached_property
    def scene(self):
        seats = (self.seat(0, (2,), team=0), self.seat(2, (0,), team=1))
        goal_lines = (GoalLine("home", 0, 0.30), GoalLine("far", 2, 0.30))
        flat = {"tilt": 0.0}
        return Scene(
            self.table_geometry, seats, pucks=1, goal_lines=goal_lines, physics=flat
        )

    def place(self, rng, worlds):
        state = self.scene.still_state(worlds)
        state.position[:, 0], state.position[:, 1] = (-0.5, 0.0), (0.5, 0.0)
        state.velocity[:, 2] = rng.uniform(-0.5, 0.5, 2)
        return state

    def reset(self, rng, worlds):
        state = self.place(rng, worlds)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state, rng):
        return super().initial_memory(state, rng) | {"goals": np.zeros((len(rng), 2))}

    def update_memory(self, t):
        scored = t.after.crossed[..., 0, ::-1]
        return {"goals": t.memory["goals"] + scored}

    observation = (
        observables.OwnPaddle(),
        observables.OtherPaddles(),
        observables.Pucks(),
        observables.OwnToPucks(),
    )

    def reward_terms(self, t):
        scored = t.new_memory["goals"] - t.memory["goals"]
        return {"goal": scored - scored[..., ::-1]}

    def needs_serve(self, t):
        return t.after.crossed[..., 0, :].any(-1)

    def serve(self, rng, state, memory):
        new = self.place(rng, len(rng))
        new.time[:] = state.time
        # Paddles play on where they are.
        new.paddle[:] = state.paddle
        new.paddle_velocity[:] = state.paddle_velocity
        return new, memory

    def success(self, t):
        return t.new_memory["goals"] >= 3


make = Pair
