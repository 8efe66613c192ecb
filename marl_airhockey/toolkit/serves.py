"""Serves: slow pucks that start around the centre of the table."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cache

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.limits import away
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.sim.jit.pipeline import Fixed, Stage
from marl_airhockey.toolkit.starts import SPIN
from marl_airhockey.types import Array, Memory

PITCH = 0.12
"""Distance between two served pucks, and between two lines of them, m."""
LINES = (0.0, PITCH, -PITCH, 2 * PITCH, -2 * PITCH)
"""x of the lines on which pucks are served, m, the line that fills first first."""
STEP = 0.02
"""Distance between two tested positions on a line, m."""
GAP = 0.005
"""Smallest distance between a served puck and any other body, m."""
SPEED = 0.5
"""Speed of a served puck, m/s."""
SPREAD = 0.3
"""Largest angle between a serve and its heading, rad."""


@dataclass(frozen=True, kw_only=True)
class ServingScenario(Scenario):
    """Base of games that continue after a goal with a serve."""

    @abstractmethod
    def headings(self, memory: Memory) -> Array:
        """Return the directions of serves (..., pucks), table frame, rad.

        They are nan for pucks that are not served.
        """

    def serve(
        self, rng: RandomStreams, state: State, memory: Memory
    ) -> tuple[State, Memory]:
        headings = self.headings(memory)
        for k in range(self.scene.pucks):
            rows = np.isfinite(headings[:, k])
            serve(rng, self.scene, state, k, headings[:, k], rows)
        return state, memory


def most_served(scene: Scene) -> int:
    """Return the largest number of pucks that can be served together."""
    return sum(_on_line(scene, x) for x in LINES)


def _room(scene: Scene, x: float) -> float:
    """Return the largest |y| of a puck on the line at x, m; below 0 if none fits."""
    table = scene.table
    inside = table.normals[:, 0] * x + table.offsets - table.puck_radius - GAP
    slope = np.abs(table.normals[:, 1])
    across = slope > 1e-9
    if (inside[~across] < 0.0).any():
        return -1.0
    return float((inside[across] / slope[across]).min())


def _on_line(scene: Scene, x: float) -> int:
    room = _room(scene, x)
    return 0 if room < 0.0 else 1 + int(2.0 * room / PITCH + 1e-9)


@cache
def _positions(scene: Scene) -> Array:
    """Return the tested positions of each puck, best first (pucks, K, 2), m.

    Pucks are side by side on the middle line, and on the next lines when it is full.
    The first position of a puck is its own. Other positions on its line follow, then
    positions on other lines.

    Raises:
        ValueError: There are more pucks than fit, or obstacles leave no space.
    """
    own: list[tuple[float, float]] = []
    for x in LINES:
        count = min(_on_line(scene, x), scene.pucks - len(own))
        own += [(x, PITCH * (k - 0.5 * (count - 1))) for k in range(count)]
    if len(own) < scene.pucks:
        raise ValueError(
            f"pucks: {scene.pucks} cannot be served together, at most {len(own)}"
        )
    obstacles = ReachPlanes.of(scene.table, scene.seats).obstacles
    tried = []
    for x, y in own:
        found = [
            (abs(line - x), abs(aside - y), -aside, line)
            for line in LINES
            if (room := _room(scene, line)) >= 0.0
            for aside in y + STEP * np.arange(-100, 101)
            if abs(aside) <= room
            and all(away(row, line, aside)[2] >= 0.0 for row in obstacles)
        ]
        tried.append([(line, -minus) for _, _, minus, line in sorted(found)])
    most = max(map(len, tried))
    if not min(map(len, tried)):
        raise ValueError("obstacles: they leave no space for a serve; move them")
    # Repeating the last position has no effect.
    return np.array([row + row[-1:] * (most - len(row)) for row in tried])


def serve(
    rng: RandomStreams,
    scene: Scene,
    state: State,
    puck: int,
    heading: Array,
    rows: Array | None = None,
) -> None:
    """Put a puck in the centre, with a velocity within 0.3 rad of a heading.

    The state is changed in place, except for its paddles. If a paddle or another puck
    is there, the puck is put at the nearest free point of its line, or of the next
    line.

    Args:
        rng: Random streams, one per row.
        scene: Scene of the state.
        state: State with rows (W,), table frame.
        puck: Index of the puck.
        heading: Directions of the velocity (W,) or (), table frame, rad.
        rows: True for the rows to serve (W,); None for all.

    Raises:
        ValueError: There are more pucks than fit, see `most_served`.
    """
    bodies, draws = state.bodies, rng.uniform(-1.0, 1.0, 2)
    some = np.ones(len(draws), np.bool_) if rows is None else rows
    _serve(
        *(state.position, state.velocity, state.spin, state.touching),
        *(bodies.puck.start, puck, np.array(bodies.radius), _positions(scene)[puck]),
        *(np.flatnonzero(some), heading + SPREAD * draws[:, 0], SPIN * draws[:, 1]),
    )


def serve_stage(
    scene: Scene, state: State, puck: int
) -> tuple[Stage, dict[str, Array]]:
    """Return a stage that serves a puck in all worlds of a state, by reference.

    Returns:
        Stage, and its inputs (W,): ``heading``, rad, and ``edge``, speed of the puck's
        edge divided by its speed.
    """
    worlds, bodies = len(state.time), state.bodies
    given = {"heading": np.zeros(worlds), "edge": np.zeros(worlds)}
    arguments = (
        *(state.position, state.velocity, state.spin, state.touching),
        *(bodies.puck.start, puck, Fixed(np.array(bodies.radius))),
        *(Fixed(_positions(scene)[puck]), Fixed(np.arange(worlds)), *given.values()),
    )
    return Stage(_serve, arguments), given


def serve_all(
    rng: RandomStreams, scene: Scene, state: State, heading: Array, between: float = 0.0
) -> None:
    """Serve all pucks, each with a heading ``between`` rad left of the previous one."""
    state.puck[:] = _positions(scene)[:, 0]
    for k in range(scene.pucks):
        serve(rng, scene, state, k, heading + k * between)


@compiled(error_model="numpy")
def _serve(
    position: Array,
    velocity: Array,
    spin: Array,
    touching: Array,
    first: int,
    puck: int,
    radius: Array,
    tried: Array,
    worlds: Array,
    heading: Array,
    edge: Array,
) -> None:
    """Serve a puck in some worlds; ``edge`` is its edge speed divided by its speed."""
    body = first + puck
    for w in worlds:
        chosen, most = 0, -np.inf
        for k in range(len(tried)):
            gap = np.inf
            for i in range(len(radius)):
                x = position[w, i, 0] - tried[k, 0]
                y = position[w, i, 1] - tried[k, 1]
                if i != body:
                    gap = min(gap, np.sqrt(x * x + y * y) - radius[i] - radius[body])
            if gap > most:
                chosen, most = k, gap
            if gap > GAP:
                break
        position[w, body, 0] = tried[chosen, 0]
        position[w, body, 1] = tried[chosen, 1]
        velocity[w, body, 0] = SPEED * cos(heading[w])
        velocity[w, body, 1] = SPEED * sin(heading[w])
        spin[w, body] = edge[w] * SPEED / radius[body]
        touching[w, :, puck] = False
