"""Feasible goals, sampled from shots at a falling puck."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.laws import bounce
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import Table
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.toolkit.starts import falling_puck, redraw, roll
from marl_airhockey.types import Array

LAWS = (
    *("tilt", "cross_tilt", "puck_damping", "puck_drag", "wall_restitution"),
    *("wall_restitution_slope", "wall_friction"),
    *("paddle_restitution", "paddle_friction", "paddle_speed"),
)
"""Names of the physics parameters that affect a shot."""
STEP, STEPS = 0.005, 500
"""Time between two points of a path, s, and number of points."""
TRIES = 200
"""Largest number of shots per puck. About 3 % are legal and reach a valid goal."""
PUSH = (0.2, 0.6)
"""Range of the paddle's speed along the contact normal, as a share of top speed."""
STRUCK = ((-0.65, 0.0), (-0.30, 0.0))
"""Ends of the range of x at which the puck is struck, m."""
PADDLE = ((-0.74, -0.24), (-0.38, 0.24))
"""Lower and upper corner of the positions of the paddle, m."""
GOAL = ((0.05, -0.205), (0.738, 0.205))
"""Lower and upper corner of the positions of goals, m."""


class Places(NamedTuple):
    """Boxes of a shot on a table: lower and upper corner (2, 2), m."""

    struck: Array
    paddle: Array
    goal: Array

    @staticmethod
    @cache
    def on(table: Table) -> Places:
        """Map the boxes of the standard table to another table."""
        boxes = (STRUCK, PADDLE, GOAL)
        return Places(*(table.from_standard(np.array(box)) for box in boxes))

    def ranges(self) -> tuple[Array, Array]:
        """Return the lower and the upper ends (4,) of the ranges of a shot.

        The ranges are x at which the puck is struck, m; angle of the contact normal,
        rad; speed of the paddle along it, share of top speed; and index of the goal on
        the path, 0 to 1.
        """
        rows = np.array([self.struck[:, 0], (-0.5, 0.5), PUSH, (0.0, 1.0)])
        return rows[:, 0], rows[:, 1]


def playable_puck(rng: RandomStreams, scene: Scene) -> Array:
    """Sample falling pucks that pass the workspace with the scene's default physics.

    Returns:
        Pucks (W, 5), columns as in `starts.falling_puck`.
    """
    physics = {name: p.default for name, p in PARAMETERS.items()} | scene.defaults
    table, places = scene.table, Places.on(scene.table)
    half = float(table.size[1]) / 2 - table.puck_radius

    def passes(pucks: Array) -> Array:
        way = roll(pucks, STEP, STEPS, half, physics)
        low, high = places.struck[:, 0]
        near = (way[..., 0] < high) & (way[..., 0] > low)
        aside = np.abs(way[..., 1]) < places.paddle[1, 1]
        return np.asarray((near & aside).mean(-1) > 0.02)

    return redraw(rng, lambda some: falling_puck(some, table), passes)


def draw_shots(
    rng: RandomStreams, scene: Scene, state: State, physics: Mapping[str, Array]
) -> Array:
    """Sample a goal for puck 0 of each world from shots that a robot seat can play.

    The puck falls to an x in `STRUCK`. A paddle with its centre in `PADDLE` strikes it
    there. The contact normal is within 0.5 rad of straight up, and the speed along it
    is in `PUSH`. The puck then slides and bounces off the long walls, with the physics
    of the episode. The goal is a random point of this path in `GOAL`, with a velocity
    within 30 deg of straight up and vx of at least 0.5 m/s. If there is none, the goal
    is (0.39, 0) m, straight up at 0.7 m/s. Positions are those of the standard table,
    see `Table.from_standard`.

    Args:
        rng: Random streams, one per row.
        scene: Scene with the table and the seat.
        state: States (W,) in which the shots begin, table frame.
        physics: Physics parameters (W,) by name.

    Returns:
        Goals (W, 4): x and y, m, vx and vy, m/s, table frame.
    """
    table, laws = scene.table, {name: physics[name] for name in LAWS}
    half = float(table.size[1]) / 2 - table.puck_radius
    motion, edge = state.puck_velocity[:, 0], state.puck_edge[:, :1]
    pucks = np.concatenate([state.puck[:, 0], motion, edge], -1)
    falls = roll(pucks, STEP, STEPS, half, laws)
    places, end = Places.on(table), table.size[0] / 2 - table.puck_radius
    none = [*table.from_standard(np.array([0.39, 0.0])), 0.7, 0.0]
    goals, left = np.tile(none, (len(rng), 1)), np.arange(len(rng))
    for _ in range(TRIES):
        draws = rng.select(left).uniform(*places.ranges(), 4)
        some = {name: value[left] for name, value in laws.items()}
        struck, legal = _strike(falls, left, draws, scene, some)
        rows = np.flatnonzero(legal)
        some = {name: value[rows] for name, value in some.items()}
        path, moment = roll(struck[rows], STEP, STEPS, half, some), np.empty_like(rows)
        _choose(path, end, places.goal, draws[rows, 3], moment)
        on = np.flatnonzero(moment >= 0)
        goals[left[rows[on]]] = path[on, moment[on], :4]
        left = np.delete(left, rows[on])
        if not len(left):
            break
    return goals


def _strike(
    falls: Array,
    worlds: Array,
    draws: Array,
    scene: Scene,
    physics: Mapping[str, Array],
) -> tuple[Array, Array]:
    """Strike each puck once; return pucks (W, 5), and True for legal shots (W,).

    Args:
        falls: Paths of all pucks (B, T, 5), see `starts.roll`.
        worlds: Indices of the struck pucks (W,).
        draws: Samples (W, 4) in `Places.ranges`.
        scene: Scene with the table.
        physics: Physics parameters (W,) by name.
    """
    height, angle, table = draws[:, 0], draws[:, 1], scene.table
    below = falls[worlds, :, 0] <= height[:, None]
    struck = falls[worlds, below.argmax(-1)]
    normal = np.stack([cos(angle), sin(angle)], -1)
    paddle = struck[:, :2] - normal * (table.paddle_radius + table.puck_radius)
    low, high = Places.on(table).paddle
    legal = below.any(-1) & ((paddle >= low) & (paddle <= high)).all(-1)
    push = physics["paddle_speed"] * draws[:, 2]
    laws = physics["paddle_restitution"], physics["paddle_friction"]
    return struck, legal & hit_pucks(struck, normal, push, *laws)


@compiled()
def hit_pucks(
    puck: Array, normal: Array, push: Array, restitution: Array, friction: Array
) -> Array:
    """Hit pucks (W, 5), in place, with paddles that move along contact normals.

    Returns:
        True where the paddle approaches the puck (W,).
    """
    met = np.zeros(len(puck), np.bool_)
    for w in range(len(puck)):
        nx, ny, vx, vy = normal[w, 0], normal[w, 1], puck[w, 2], puck[w, 3]
        closing = push[w] - nx * vx - ny * vy
        if closing <= 0.0:
            continue
        met[w] = True
        bounce(puck[w], nx, ny, closing, 0.0, restitution[w], friction[w])
    return met


@compiled()
def _choose(path: Array, end: float, goal: Array, choice: Array, moment: Array) -> None:
    """Choose a valid index of each rising path (W, T, 5); -1 if there is none."""
    steep = np.sqrt(1.0 / 3.0)
    for w in range(len(path)):
        good, moment[w] = 0, -1
        # Two passes: the first counts the valid indices, the second chooses one.
        for take in range(2):
            wanted, count = int(choice[w] * good) if take else -1, 0
            for t in range(path.shape[1]):
                x, y = path[w, t, 0], path[w, t, 1]
                vx, vy = path[w, t, 2], path[w, t, 3]
                if vx <= 0.2 or x >= end:
                    break
                if not (goal[0, 0] < x < goal[1, 0] and abs(y) < goal[1, 1]):
                    continue
                if vx >= 0.5 and abs(vy) < steep * vx:
                    if count == wanted:
                        moment[w] = t
                    count += 1
            good = count
