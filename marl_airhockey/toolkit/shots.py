"""Shots: feasible goals, drawn from legal shots at a falling puck."""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.core.laws import impulse
from marl_airhockey.core.physics import PARAMETERS
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.toolkit.starts import falling_puck, roll
from marl_airhockey.types import Array

STEP, STEPS = 0.005, 500
"""Time between points of a way (s), and their number"""
TRIES = 20
"""Number of shots tried at a puck before another puck is drawn."""


def legal_shots(rng: RandomStreams, scene: Scene) -> tuple[Array, Array]:
    """Draw falling pucks, and for each a goal on a shot that a robot seat can play.

    The puck falls to x in -0.65 .. -0.30 and is struck there with a contact normal
    within 0.5 rad of straight up and a normal paddle speed of 0 .. 0.6 m/s, the
    paddle's centre lying in x -0.74 .. -0.38 and |y| <= 0.24; it slides on with banks.
    The goal is a random point of that path with x 0.05 .. 0.738, |y| < 0.205, within
    30 deg of straight up and vx at least 0.5 m/s.

    Returns:
        (W, 5) x, y, vx, vy, m, m/s, and speed of the edge by spin, m/s, of the puck at
        its start, and (W, 4) x, y, vx, vy of the goal.

    Raises:
        RuntimeError: no shot was found in 100 pucks.
    """
    pucks, goals = np.zeros((len(rng), 5)), np.zeros((len(rng), 4))
    open_rows = np.arange(len(rng))
    for attempt in range(100 * TRIES):
        some = rng.select(open_rows)
        if attempt % TRIES == 0:
            pucks[open_rows] = falling_puck(some)
        goal, found = _shoot(some, pucks[open_rows], scene)
        goals[open_rows[found]] = goal[found]
        open_rows = open_rows[~found]
        if not len(open_rows):
            return pucks, goals
    raise RuntimeError("start: no legal shot in 100 pucks")


def shots_at(rng: RandomStreams, scene: Scene, state: State) -> Array:
    """Draw a goal on a legal shot (see `legal_shots`) at puck 0 of each world.

    If none is found in 100 tries, the goal is one of a shot at another puck.

    Returns:
        (W, 4) x, y, vx, vy of the goal.
    """
    _, goals = legal_shots(rng, scene)
    motion, edge = state.puck_velocity[:, 0], state.puck_edge[:, :1]
    pucks = np.concatenate([state.puck[:, 0], motion, edge], -1)
    open_rows = np.arange(len(rng))
    for _ in range(100):
        goal, found = _shoot(rng.select(open_rows), pucks[open_rows], scene)
        goals[open_rows[found]] = goal[found]
        open_rows = open_rows[~found]
    return goals


def _shoot(rng: RandomStreams, puck: Array, scene: Scene) -> tuple[Array, Array]:
    """Shoot once at each puck; return a random goal (W, 4), and if there is one."""
    table, physics = scene.table, {k: p.default for k, p in PARAMETERS.items()}
    physics.update(scene.defaults)
    half = float(table.size[1]) / 2 - table.puck_radius
    ways = STEP, STEPS, half, physics
    height = rng.uniform(-0.65, -0.30)
    angle = rng.uniform(-0.5, 0.5)
    push = rng.uniform(0.0, 0.6)
    choice = rng.uniform(0.0, 1.0)
    rows = np.arange(len(rng))

    fall = roll(puck, *ways)
    struck = fall[rows, (fall[..., 0] <= height[:, None]).argmax(-1)]
    normal = np.stack([np.cos(angle), np.sin(angle)], -1)
    paddle = struck[:, :2] - normal * (table.paddle_radius + table.puck_radius)
    legal = (struck[:, 0] <= height) & (np.abs(paddle[:, 1]) <= 0.24)
    legal &= (paddle[:, 0] >= -0.74) & (paddle[:, 0] <= -0.38)

    laws = physics["paddle_restitution"], physics["paddle_friction"]
    legal &= _hit(struck, normal, push, *laws)
    path = roll(struck, *ways)
    moment = np.empty(len(rows), np.int64)
    _choose(path, table.size[0] / 2 - table.puck_radius, choice, moment)
    return path[rows, moment, :4], legal & (moment >= 0)


@njit(cache=True)
def _hit(
    puck: Array, normal: Array, push: Array, restitution: float, friction: float
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
        met[w], slip = True, nx * vy - ny * vx - puck[w, 4]
        along, aside = impulse(closing, slip, restitution, friction, 1.0, 3.0)
        puck[w, 2] += along * nx - aside * ny
        puck[w, 3] += along * ny + aside * nx
        puck[w, 4] -= 2.0 * aside
    return met


@njit(cache=True)
def _choose(path: Array, end: float, choice: Array, moment: Array) -> None:
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
                if not (0.05 < x < 0.738 and abs(y) < 0.205):
                    continue
                if vx >= 0.5 and abs(vy) < steep * vx:
                    if count == wanted:
                        moment[w] = t
                    count += 1
            good = count
