"""Bases of tasks in which a puck falls towards one seat."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from marl_airhockey.sim.contracts.observable import Observable
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import GoalLine, Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.toolkit import observables, starts
from marl_airhockey.types import Array, Memory


@dataclass(frozen=True, kw_only=True)
class FallingPuck(Scenario):
    """Base of tasks in which a puck falls from the far half towards one seat.

    The home side is a goal line. The memory contains ``gap`` (...), the shortest
    distance between paddle and puck until the first touch, m. Subclasses update it with
    `rewards.nearest`.
    """

    PATH: ClassVar[bool] = False
    """True if states contain the path of the puck within a step."""

    @cached_property
    def scene(self) -> Scene:
        home, seats = GoalLine("home", 0), (self.seat(),)
        table, path = self.table_geometry, self.PATH
        return Scene(table, seats, pucks=1, goal_lines=(home,), path=path)

    def reset(self, rng: RandomStreams, worlds: int) -> tuple[State, Memory]:
        state = starts.falling(rng, self.scene)
        return state, self.initial_memory(state, rng)

    def initial_memory(self, state: State, rng: RandomStreams) -> Memory:
        memory = super().initial_memory(state, rng)
        return {**memory, "gap": starts.puck_gap(state)}

    observation: ClassVar[tuple[Observable, ...]] = (
        observables.OwnPaddle(),
        observables.Pucks(),
        observables.OwnToPucks(),
        observables.Touched(),
    )


@dataclass(frozen=True, kw_only=True)
class FewShots(FallingPuck):
    """Base of tasks in which one of the first shots must succeed.

    Without a limit chance succeeds: after enough shots, a controller that does not
    observe the goal hits it. The touch after the last shot ends the episode.
    """

    shots: int = 2
    """Number of distinct touches within which the task must succeed."""

    def within_shots(self, memory: Memory) -> Array:
        """Return True (...) if the number of distinct touches is at most `shots`."""
        return np.asarray(memory["touches"].sum((-1, -2)) <= self.shots)
