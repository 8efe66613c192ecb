"""A two-seat game for the tests: shows what games need of the core.

Seats face each other, a goal serves the puck again inside the episode.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.scene import GoalLine, Scene
from marl_airhockey.toolkit import observables as observables
from marl_airhockey.toolkit import rewards, starts


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

    def serve(self, rng, worlds):
        state = starts.first_state(self.scene, worlds)
        state.position[:, 0], state.position[:, 1] = (-0.5, 0.0), (0.5, 0.0)
        state.velocity[:, 2] = rng.uniform(-0.5, 0.5, 2)
        return state

    def start(self, rng, worlds):
        memory = rewards.no_touches(worlds, 2, 1) | {"goals": np.zeros((worlds, 2))}
        return self.serve(rng, worlds), memory

    def update_memory(self, memory, before, command, after):
        scored = after.crossed[..., 0, ::-1]
        return {"goals": memory["goals"] + scored}

    observation = (
        observables.OwnPaddle(),
        observables.OtherPaddles(),
        observables.Pucks(),
        observables.OwnToPucks(),
    )

    def reward_terms(self, before, command, after, old, new):
        scored = new["goals"] - old["goals"]
        return {"goal": scored - scored[..., ::-1]}

    def restart(self, rng, after, memory):
        worlds = np.flatnonzero(after.crossed[..., 0, :].any(-1))
        if not len(worlds):
            return None
        state = self.serve(rng.select(worlds), len(worlds))
        state.time[:] = after.time[worlds]
        # Paddles play on where they are.
        state.paddle[:] = after.paddle[worlds]
        state.paddle_velocity[:] = after.paddle_velocity[worlds]
        return worlds, state, {k: v[worlds] for k, v in memory.items()}

    def success(self, after, memory):
        return memory["goals"] >= 3


make = Pair
