"""Checks of given states: bodies on the table, without overlap, and not too fast."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from marl_airhockey.sim.core.geometry import length, products
from marl_airhockey.sim.core.limits import away
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import ReachPlanes, reaches
from marl_airhockey.sim.core.state import Kind, State
from marl_airhockey.types import Array

DEEPEST = 0.01
"""Largest overlap of bodies, m; contacts of pymunk and robosuite are soft."""
PRESSED = 0.02
"""Largest depth to which a position-driven paddle may press a puck into a side, m,
which pymunk allows."""
REACH_SLACK = 0.03
"""Largest distance of an arm's paddle beyond its workspace, m."""
FASTEST = 50.0
"""Largest speed of a body, m/s."""


def check_placement(state: State, scene: Scene, parked: Array, longest: float) -> None:
    """Check that positions, speeds and times of a given state are possible.

    A position-driven paddle may overlap a puck. A paddle that a teammate pushes may
    overlap an obstacle.

    Args:
        state: State of W worlds.
        scene: Scene on the table.
        parked: True for paddles of eliminated players (W, seats).
        longest: Length of an episode, s.

    Raises:
        ValueError: A value is not possible. The message names the first body, its world
            and the bound.
    """
    _refuse("its time is {} s", state.time, longest + 1e-9, 1.0)
    _refuse("its time is {} s before the episode", -state.time, 0.0, 1.0)
    names = [
        f"{kind.name.lower()}_{k}"
        for kind in Kind
        for k in range(state.bodies.kind.count(kind))
    ]
    gone = np.zeros((len(parked), len(names)), np.bool_)
    gone[:, state.bodies.paddle] = parked
    for i in range(state.bodies.movers):
        speed = length(state.velocity[:, i])
        _refuse(f"{names[i]} moves at {{}} m/s", speed, FASTEST, 1.0)
        rim = np.abs(state.spin[:, i]) * state.bodies.radius[i]
        _refuse(f"{names[i]} spins at {{}} m/s at its rim", rim, FASTEST, 1.0)
        off = np.where(gone[:, i], 0.0, _depth(state, scene, i))
        puck = state.bodies.kind[i] is Kind.PUCK
        most = PRESSED if puck else DEEPEST
        _refuse(f"{names[i]} is off the table by {{}} mm", off, most)
    beyond = np.where(parked, 0.0, _beyond_reach(state, scene))
    for i in range(state.bodies.paddles):
        what = f"paddle_{i} is outside the workspace of its seat by {{}} mm"
        _refuse(what, beyond[:, i], REACH_SLACK)
    # A puck that has ended a game stays on the goal line, and paddles may overlap it.
    gone[:, state.bodies.puck] = _on_goal_line(state, scene)
    paddles, pucks = state.bodies.paddles, state.bodies.pucks
    for i, k in combinations(range(state.bodies.movers), 2):
        if i < paddles <= k < paddles + pucks:
            continue
        between = length(state.position[:, i] - state.position[:, k])
        overlap = state.bodies.radius[i] + state.bodies.radius[k] - between
        overlap[gone[:, i] | gone[:, k]] = 0.0
        _refuse(f"{names[i]} and {names[k]} overlap by {{}} mm", overlap, DEEPEST)


def _refuse(what: str, values: Array, most: float, scale: float = 1e3) -> None:
    """Raise an error for the first value above a bound; the text is times ``scale``."""
    worlds = np.flatnonzero(values > most)
    if len(worlds):
        found = what.format(f"{scale * values[worlds[0]]:.4g}")
        where = f" in world {worlds[0]}" if len(values) > 1 else ""
        raise ValueError(f"state: {found}{where}; at most {scale * most:g} is possible")


def _depth(state: State, scene: Scene, body: int) -> Array:
    """Return the depth of a body in a side or an obstacle (W,), m; < 0 outside of both.

    The centre of a puck may be on a goal line. For paddles only sides are checked.
    """
    table, position = scene.table, state.position[:, body]
    radius = state.bodies.radius[body]
    depth = radius - (products(position, table.normals) + table.offsets)
    if state.bodies.kind[body] is Kind.PUCK:
        depth[_before_goal(position, scene)] -= radius
    paddle = state.bodies.kind[body] is Kind.PADDLE
    for row in () if paddle else ReachPlanes.of(table, scene.seats).obstacles:
        clear = [away(row, x, y)[2] for x, y in position]
        gap = np.array(clear) + table.paddle_radius - radius
        depth = np.column_stack([depth, -gap])
    return np.asarray(depth.max(-1))


def _before_goal(position: Array, scene: Scene) -> Array:
    """Return True for points between the ends of a side's goal line (..., sides)."""
    sides = scene.table.normals.shape[0]
    before = np.zeros((*position.shape[:-1], sides), np.bool_)
    for line in scene.goal_lines:
        start, end = scene.opening(line)
        reach = length(end - start) / 2
        along = ((position - (start + end) / 2) * (end - start)).sum(-1) / (2 * reach)
        before[..., line.side] |= np.abs(along) < reach
    return before


def _on_goal_line(state: State, scene: Scene) -> Array:
    """Return True for pucks with the centre on or beyond a goal line (W, pucks)."""
    depth = -(products(state.puck, scene.table.normals) + scene.table.offsets)
    return np.asarray((_before_goal(state.puck, scene) & (depth > -1e-6)).any(-1))


def _beyond_reach(state: State, scene: Scene) -> Array:
    """Return the distance of each paddle beyond its workspace (W, seats), m."""
    normals, offsets = reaches(scene.table, scene.seats)
    inside = (normals * state.paddle[..., None, :]).sum(-1) + offsets
    return np.asarray(-inside.min(-1))
