"""Elements of a scene that options add: obstacles and regions with drag."""

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
"""Largest number of samples of a start that is clear of the obstacles."""
SERVE_ROOM = 0.1
"""Smallest distance of obstacles from the centre, where pucks are served, m."""


def check_elements(scenario: Scenario, real: bool) -> None:
    """Check that the scenario or the real table supports its elements.

    Raises:
        ValueError: An option is not supported; the message states the reason.
    """
    if scenario.drag_regions and scenario.scene.pucks != 1:
        raise ValueError(
            f"drag_regions: expected a scenario with one puck, {scenario.name} has "
            f"{scenario.scene.pucks}"
        )
    if scenario.drag_regions and real:
        raise ValueError(
            "drag_regions: not possible on a real table; leave the option out"
        )
    if type(scenario).serve is Scenario.serve:
        return
    table, seats = scenario.scene.table, scenario.scene.seats
    room = SERVE_ROOM - table.paddle_radius
    for row in ReachPlanes.of(table, seats).obstacles:
        if away(row, 0.0, 0.0)[2] < room:
            raise ValueError(
                f"obstacles: pucks are served at the centre of the table; leave "
                f"{SERVE_ROOM} m free around it"
            )


def clear_start(
    scenario: Scenario, rng: RandomStreams, worlds: int
) -> tuple[State, Memory]:
    """Sample starts in which no body and no target overlaps an obstacle.

    Raises:
        ValueError: No such start was found.
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
    raise ValueError(f"obstacles: {scenario.obstacles} leave no space for a start")


def _blocked(scenario: Scenario, state: State, memory: Memory) -> Array:
    """Return True for worlds in which a body or a target is in an obstacle (W,)."""
    points = state.position[:, : state.bodies.movers]
    targets = scenario.targets(memory)
    if targets is not None:
        points = np.concatenate([points, targets], 1)
    rows = ReachPlanes.of(scenario.scene.table, scenario.scene.seats).obstacles
    # Paddles are the largest bodies that move.
    found = [
        any(away(row, x, y)[2] < 0.0 for row in rows for x, y in world)
        for world in points
    ]
    return np.array(found, np.bool_)


class DragRegions:
    """Drag of the puck in regions, set in the backend when it enters or leaves one."""

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        self._scenario, self._set = scenario, np.full(worlds, np.nan)

    def forget(self, worlds: Array) -> None:
        """Set the drag again in the next step of some worlds, by index (W,)."""
        self._set[worlds] = np.nan

    def update(self, backend: Backend, state: State, physics: dict[str, Array]) -> None:
        """Set the drag of the pucks at their positions."""
        added = self._scenario.added_drag(state)[:, 0]
        changed = np.flatnonzero(added != self._set)
        if len(changed):
            damping = physics["puck_damping"] + added
            backend.set_physics({**physics, "puck_damping": damping}, changed)
            self._set[changed] = added[changed]
