"""Shots: feasible goals, drawn from legal shots at a falling puck."""

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
from marl_airhockey.toolkit.starts import falling_puck, redraw, roll
from marl_airhockey.types import Array

LAWS = (
    *("tilt", "cross_tilt", "puck_damping", "puck_drag", "wall_restitution"),
    *("wall_restitution_slope", "wall_friction"),
    *("paddle_restitution", "paddle_friction", "paddle_speed"),
)
"""Names of the parameters that a shot depends on."""
STEP, STEPS = 0.005, 500
"""Time between points of a way (s), and their number"""
TRIES = 200
"""Number of shots tried at a puck; about 3 % are legal and reach such a place."""
PUSH = (0.2, 0.6)
"""Range of the paddle's speed along the normal, as a share of its top speed."""
STRUCK = ((-0.65, 0.0), (-0.30, 0.0))
"""Range of x at which the puck is struck (m)."""
PADDLE = ((-0.74, -0.24), (-0.38, 0.24))
"""Lower and upper corner of the paddle's places (m)."""
GOAL = ((0.05, -0.205), (0.738, 0.205))
"""Lower and upper corner of the goals' places (m)."""


class Places(NamedTuple):
    """Places of a shot on a table, each by its lower and upper corner (2, 2), m."""

    struck: Array
    paddle: Array
    goal: Array

    @staticmethod
    @cache
    def on(table: Table) -> Places:
        """Carry those of the standard table over to another."""
        boxes = (STRUCK, PADDLE, GOAL)
        return Places(*(table.from_standard(np.array(box)) for box in boxes))

    def ranges(self) -> tuple[Array, Array]:
        """Return the ends (4,) of the ranges of a shot.

        x at which the puck is struck (m), angle of the normal (rad), speed of the
        paddle along it (of top speed), and which point of the way is the goal.
        """
        rows = np.array([self.struck[:, 0], (-0.5, 0.5), PUSH, (0.0, 1.0)])
        return rows[:, 0], rows[:, 1]


def playable_puck(rng: RandomStreams, scene: Scene) -> Array:
    """Draw falling pucks that pass where a paddle can be, under the scene's physics.

    Returns:
        (W, 5), see `starts.falling_puck`.
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
    """Draw a goal on a shot at puck 0 of each world that a robot seat can play.

    The puck falls to a place in `STRUCK` and is struck there with a contact normal
    within 0.5 rad of straight up and a normal paddle speed of `PUSH`, the paddle's
    centre lying in `PADDLE`; it slides on with banks, under the physics of the episode.
    The goal is a random point of that path in `GOAL`, within 30 deg of straight up and
    vx at least 0.5 m/s. Where none is found, it is (0.39, 0), straight up at 0.7 m/s.
    Places are those of the standard table, see `Table.from_standard`.

    Args:
        rng: one stream per row.
        scene: table and seat.
        state: rows (W,), one of which each shot begins in.
        physics: parameters by name, (W,) each.

    Returns:
        (W, 4) x, y, m, vx, vy, m/s, of the goals.
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
    """Strike each puck once; return it (W, 5), and whether the shot is legal (W,).

    Args:
        falls: ways of all pucks, see `starts.roll`.
        worlds: (W,) those that are struck, by index.
        draws: (W, 4) in `Places.ranges`.
        scene: table.
        physics: parameters by name, (W,) each.
    """
    height, angle, table = draws[:, 0], draws[:, 1], scene.table
    below = falls[worlds, :, 0] <= height[:, None]
    struck = falls[worlds, below.argmax(-1)]
    normal = np.stack([np.cos(angle), np.sin(angle)], -1)
    paddle = struck[:, :2] - normal * (table.paddle_radius + table.puck_radius)
    low, high = Places.on(table).paddle
    legal = below.any(-1) & ((paddle >= low) & (paddle <= high)).all(-1)
    push = physics["paddle_speed"] * draws[:, 2]
    laws = physics["paddle_restitution"], physics["paddle_friction"]
    return struck, legal & _hit(struck, normal, push, *laws)


@compiled()
def _hit(
    puck: Array, normal: Array, push: Array, restitution: Array, friction: Array
) -> Array:
    """Hit pucks (W, 5), changed, by paddles that move along their normals.

    Returns:
        True where the paddle meets the puck (W,).
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
    """Choose a valid index of each rising path (W, T, 4); -1 if there is none."""
    steep = np.tan(np.radians(30.0))
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
