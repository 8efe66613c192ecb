"""Elements of a scene that a scenario's options add: obstacles and regions of drag."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.backend import Backend
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.limits import away
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.core.state import RESULTS, State
from marl_airhockey.types import Array, Memory

TRIES = 1000
"""Number of starts that are sampled until one is clear of the obstacles"""
SERVE_ROOM = 0.1
"""Distance (m) from the middle of the table, where pucks are served, to obstacles"""


def check_elements(scenario: Scenario, real: bool) -> None:
    """Refuse elements that a scenario or a real table cannot have.

    Raises:
        ValueError: An option, named, and why.
    """
    if scenario.drag_regions and scenario.scene.pucks != 1:
        raise ValueError(
            f"drag_regions: one puck is needed, {scenario.name} has "
            f"{scenario.scene.pucks}"
        )
    if scenario.drag_regions and real:
        raise ValueError("drag_regions: a real table has none")
    if type(scenario).serve is Scenario.serve:
        return
    table, seats = scenario.scene.table, scenario.scene.seats
    room = SERVE_ROOM - table.paddle_radius
    for row in ReachPlanes.of(table, seats).obstacles:
        if away(row, 0.0, 0.0)[2] < room:
            raise ValueError(
                f"obstacles: pucks are served in the middle of the table; leave "
                f"{SERVE_ROOM} m free around it"
            )


def clear_start(
    scenario: Scenario, rng: RandomStreams, worlds: int
) -> tuple[State, Memory]:
    """Sample starts in which no body, and no target, is at an obstacle.

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
    """(W,) bool: a body or a target of a world overlaps an obstacle."""
    points = state.position[:, : state.bodies.movers]
    targets = scenario.targets(memory)
    if targets is not None:
        points = np.concatenate([points, targets], 1)
    rows = ReachPlanes.of(scenario.scene.table, scenario.scene.seats).obstacles
    # Paddles are the largest of what moves.
    found = [
        any(away(row, x, y)[2] < 0.0 for row in rows for x, y in world)
        for world in points
    ]
    return np.array(found, np.bool_)


class DragRegions:
    """Drag of the puck in regions, set in the backend as it enters and leaves them."""

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        self._scenario, self._set = scenario, np.full(worlds, np.nan)

    def forget(self, worlds: Array) -> None:
        """Set the drag again at the next step of some worlds, by index."""
        self._set[worlds] = np.nan

    def update(self, backend: Backend, state: State, physics: dict[str, Array]) -> None:
        """Set the drag that pucks have where they are."""
        added = self._scenario.added_drag(state)[:, 0]
        changed = np.flatnonzero(added != self._set)
        if len(changed):
            damping = physics["puck_damping"] + added
            backend.set_physics({**physics, "puck_damping": damping}, changed)
            self._set[changed] = added[changed]
