"""Serves: pucks that are put around the middle of the table, moving slowly."""

from __future__ import annotations

from functools import cache

import numpy as np

from marl_airhockey.sim.core.limits import away
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.toolkit.starts import SPIN
from marl_airhockey.types import Array

PITCH = 0.12
"""Distance between two served pucks, and between two lines of them (m)."""
LINES = (0.0, PITCH, -PITCH, 2 * PITCH, -2 * PITCH)
"""x of the lines on which pucks are served, in the order in which they fill (m)."""
STEP = 0.02
"""Distance between two positions on a line that are tried (m)."""
GAP = 0.005
"""Least distance between a served puck and anything else (m)."""
SPEED = 0.5
"""Speed of a served puck (m/s)."""


def most_served(scene: Scene) -> int:
    """Return how many pucks a table has room for when all are served together."""
    return sum(_on_line(scene, x) for x in LINES)


def _room(scene: Scene, x: float) -> float:
    """Return how far from the middle a puck may be on the line at x, m; < 0: none."""
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
    """Return the positions that are tried for each puck, best first (pucks, K, 2), m.

    Pucks are side by side on the middle line, and on the next ones when it is full. A
    puck's own position is first; others on its line follow, then those on other lines.

    Raises:
        ValueError: more pucks than fit.
    """
    own: list[tuple[float, float]] = []
    for x in LINES:
        count = min(_on_line(scene, x), scene.pucks - len(own))
        own += [(x, PITCH * (k - 0.5 * (count - 1))) for k in range(count)]
    if len(own) < scene.pucks:
        raise ValueError(
            f"pucks: {scene.pucks} do not fit where they are served, {len(own)} do"
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
        raise ValueError("obstacles: they leave no room for a serve")
    # A last position that is repeated changes nothing.
    return np.array([row + row[-1:] * (most - len(row)) for row in tried])


def serve(
    rng: RandomStreams,
    scene: Scene,
    state: State,
    puck: int,
    heading: Array,
    rows: Array | None = None,
) -> None:
    """Put a puck in the middle, moving within 0.3 rad of a heading.

    The state is changed in place, but for its paddles. Where a paddle or another puck
    is there, the puck is put at the nearest free point of its line, or of the
    next one.

    Args:
        rng: one stream per row.
        scene: what is on the table.
        state: rows (W,).
        puck: its index.
        heading: (W,) or (), rad in the table frame.
        rows: (W,) bool: True for the rows to serve; None for all.

    Raises:
        ValueError: more pucks than fit, see `most_served`.
    """
    bodies, draws = state.bodies, rng.uniform(-1.0, 1.0, 2)
    some = np.ones(len(draws), np.bool_) if rows is None else rows
    _serve(
        *(state.position, state.velocity, state.spin, state.touching),
        *(bodies.puck.start, puck, np.array(bodies.radius), _positions(scene)[puck]),
        *(np.flatnonzero(some), heading + 0.3 * draws[:, 0], SPIN * draws[:, 1]),
    )


def serve_all(
    rng: RandomStreams, scene: Scene, state: State, heading: Array, between: float = 0.0
) -> None:
    """Serve all pucks, the heading of each ``between`` rad left of the one before."""
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
    """Serve in some worlds; ``edge`` is the speed of the edge per speed of the puck."""
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
        velocity[w, body, 0] = SPEED * np.cos(heading[w])
        velocity[w, body, 1] = SPEED * np.sin(heading[w])
        spin[w, body] = edge[w] * SPEED / radius[body]
        touching[w, :, puck] = False
