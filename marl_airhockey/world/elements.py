"""Elements of a scene that a scenario's options add: obstacles and regions of drag."""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.backend import Backend
from marl_airhockey.contracts.scenario import GoalScenario, Scenario
from marl_airhockey.core.limits import away
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.core.state import RESULTS, State
from marl_airhockey.types import Array, Memory

TRIES = 1000
"""Number of starts that are drawn until one is clear of the obstacles"""


def clear_start(
    scenario: Scenario, rng: RandomStreams, worlds: int
) -> tuple[State, Memory]:
    """Draw starts in which no body, and no goal, is at an obstacle.

    Raises:
        ValueError: Obstacles leave no room.
    """
    state, memory = scenario.reset(rng, worlds)
    if not scenario.table_geometry.obstacles:
        return state, memory
    for _ in range(TRIES):
        again = np.flatnonzero(_blocked(scenario, state, memory))
        if not len(again):
            return state, memory
        some, rows = scenario.reset(rng.select(again), len(again))
        for name in RESULTS:
            getattr(state, name)[again] = getattr(some, name)
        for name, values in rows.items():
            memory[name][again] = values
    raise ValueError(f"obstacles: {scenario.obstacles} leave no room for a start")


def _blocked(scenario: Scenario, state: State, memory: Memory) -> Array:
    """(W,) bool: a body or the goal of a world overlaps an obstacle."""
    goals = isinstance(scenario, GoalScenario) and "goal" in memory
    found = np.zeros(len(state.time), np.bool_)
    for obstacle in ReachPlanes.of(
        scenario.table_geometry, scenario.scene.seats
    ).obstacles:
        for w in range(len(found)):
            points = [*state.position[w, : state.bodies.movers]]
            points += [memory["goal"][w, :2]] if goals else []
            # Paddles are the largest of what moves.
            found[w] |= any(away(obstacle, x, y)[2] < 0.0 for x, y in points)
    return found


class DragRegions:
    """Drag of pucks in regions, set in the backend as pucks enter and leave them.

    Raises:
        ValueError: There is not one puck.
    """

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        pucks = scenario.scene.pucks
        if pucks != 1:
            raise ValueError(
                f"drag_regions: need one puck, {scenario.name} has {pucks}"
            )
        self._scenario, self._set = scenario, np.full(worlds, np.nan)

    def forget(self, worlds: Array) -> None:
        """Set the drag anew at the next step of some worlds, by index."""
        self._set[worlds] = np.nan

    def update(self, backend: Backend, state: State, physics: dict[str, Array]) -> None:
        """Set the drag that pucks have where they are."""
        added = self._scenario.added_drag(state)[:, 0]
        changed = np.flatnonzero(added != self._set)
        if len(changed):
            damping = physics["puck_damping"] + added
            backend.set_physics({**physics, "puck_damping": damping}, changed)
            self._set[changed] = added[changed]
