"""Planner of one shot at a falling puck, by random search over simulated shots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from marl_airhockey.sim.core.geometry import half_planes, length
from marl_airhockey.sim.core.table import GRAVITY
from marl_airhockey.sim.world.world import World
from marl_airhockey.toolkit.shots import hit_pucks
from marl_airhockey.toolkit.starts import roll
from marl_airhockey.types import Array

STEP, STEPS = 0.01, 200
"""Time between two points of a planned path, s, and number of points."""
SHOTS, FIRST, AGAIN = 300, (1.0, 0.15, 0.025, 0.004), (0.1, 0.02, 0.004)
"""Number of shots per round of the search, and widths of its rounds: of the first
search, and of the one just before the paddle moves, as shares of `RANGES`."""
FAR = 9.0
"""Miss of a path that does not rise."""
BESIDE = np.array([0.0, -0.001, 0.001])
"""Distances of the paddle to the side of its plan at which a shot is simulated, m."""
MARGIN = 0.002
"""Distance to the edges of the workspace beyond the way to brake, m."""
RANGES = np.array([(-0.50, -0.24), (-1.1, 1.1), (0.1, 0.98)])
"""Ranges of a shot: x of the puck, m; angle of the contact normal, rad; speed of the
paddle along it, share of top speed."""
SOONEST = 0.01
"""Shortest time from a plan to the contact, s."""
RUN_UP = 0.05
"""Longest time for which the paddle moves before the contact, s."""


# Misses of paths: below 1 for a success.


@dataclass(frozen=True)
class Aim:
    """What n paths have to meet, and the physics in which the planner believes."""

    game: Any
    """Scenario."""
    goal: Mapping[str, Array]
    """Goals, their velocities, and blocks (n, 2), by name."""
    laws: Mapping[str, Array]
    """Physics parameters (n,)."""


def miss_circle(path: Array, aim: Aim) -> Array:
    """Return how far paths (n, T, 5) miss a circle, in radii (n,)."""
    gap = length(path[..., :2] - aim.goal["goal"][:, None])
    gap = np.where(path[..., 2] > 0.0, gap, FAR).min(-1)
    return np.asarray(gap / aim.game.radius)


def miss_velocity(path: Array, aim: Aim) -> Array:
    """Return how far paths (n, T, 5) miss a circle with a target velocity (n,)."""
    wanted, game = aim.goal["goal_velocity"][:, None], aim.game
    speed, target = length(path[..., 2:4]), length(wanted)
    dot = (path[..., 2:4] * wanted).sum(-1) / np.maximum(speed * target, 1e-6)
    off = np.arccos(np.clip(dot, -1.0, 1.0)) / np.radians(game.angle)
    slack = game.speed_share * target + game.speed_slack
    gap = length(path[..., :2] - aim.goal["goal"][:, None]) / game.radius
    worst = np.maximum(np.maximum(gap, off), np.abs(speed - target) / slack)
    return np.asarray(np.where(path[..., 2] > 0.0, worst, FAR).min(-1))


def miss_block(path: Array, aim: Aim) -> Array:
    """Return the inverse of a block's displacement, or the gap to it (n,)."""
    laws, block = aim.laws, aim.game.scene.block_radius
    apart = aim.goal["block"][:, None] - path[..., :2]
    gap = length(apart) - aim.game.scene.table.puck_radius - block
    gap = np.where(path[..., 2] > 0.0, gap, FAR)
    met = gap < 0.0
    last, rows = np.maximum(met.argmax(-1) - 1, 0), np.arange(len(path))
    velocity, before = path[rows, last, 2:4], apart[rows, last]
    # Time from the point before the contact until the two discs touch.
    a, b = (velocity**2).sum(-1), (velocity * before).sum(-1)
    c = (before**2).sum(-1) - (aim.game.scene.table.puck_radius + block) ** 2
    until = (b - np.sqrt(np.maximum(b * b - a * c, 0.0))) / np.maximum(a, 1e-9)
    normal = before - until[:, None] * velocity
    normal /= length(normal)[:, None]
    closing = np.maximum((velocity * normal).sum(-1), 1e-3)
    share = laws["puck_mass"] / (laws["puck_mass"] + laws["block_mass"])
    kick = (1.0 + laws["block_restitution"]) * share * closing
    pull = GRAVITY * np.sin(np.radians(laws["tilt"])) * normal[:, 0]
    way = kick**2 / (2.0 * (laws["block_friction"] + pull))
    beyond = 2.0 + np.maximum(gap.min(-1), 0.0) / block
    missed = np.where(met.any(-1), np.minimum(aim.game.way / way, 2.0), beyond)
    return np.asarray(missed)


Miss = Callable[[Array, Aim], Array]
MISS: dict[str, Miss] = {
    "hit_goal": miss_circle,
    "move_block": miss_block,
    "hit_goal_velocity": miss_velocity,
}
"""Functions by task."""


def inside(world: World, position: Array, velocity: Array) -> Array:
    """Return True where a paddle can brake before the edges of its workspace (n,)."""
    normals, offsets = half_planes(world.scene.seats[0].reach)
    distance = position @ normals.T + offsets
    toward = np.maximum(-velocity @ normals.T, 0.0)
    way = toward**2 / (2.0 * world.physics.highest("paddle_acceleration"))
    return np.asarray((distance > way + MARGIN).all(-1))


@dataclass
class Shots:
    """Shots at the pucks of B worlds."""

    draw: Array
    """Numbers of `RANGES` (B, 3)."""
    contact: Array
    """Positions (B, 2) of the paddle at the contact, m."""
    velocity: Array
    """Velocities (B, 2) of the paddle, m/s."""
    time: Array
    """Times (B,) of the contact since the plan, s; inf without a legal shot."""

    @staticmethod
    def none(worlds: int) -> Shots:
        """Return no shots, in the middle of the ranges."""
        draw = np.tile(RANGES.mean(1), (worlds, 1))
        contact, velocity = np.zeros((2, worlds, 2))
        return Shots(draw, contact, velocity, np.full(worlds, np.inf))


def plan(
    world: World,
    pucks: Array,
    aim: Aim,
    miss: Miss,
    middle: Array,
    widths: tuple[float, ...],
    rng: np.random.Generator,
) -> Shots:
    """Return the best shots at pucks (W, 5).

    Args:
        world: Worlds, of which only known values are used.
        pucks: Pucks in which the planner believes: x, y, m; vx, vy and edge speed, m/s.
        aim: Goals of the shots, for each puck.
        miss: Function of `MISS`.
        middle: Numbers (W, 3) around which the search begins.
        widths: Widths of the search in its rounds, as shares of `RANGES`.
        rng: Random generator.
    """
    table, (w, n) = world.scene.table, (len(pucks), SHOTS)
    half = float(table.size[1]) / 2 - table.puck_radius
    near = table.paddle_radius + table.puck_radius
    falls = roll(pucks, STEP, STEPS, half, aim.laws)
    top = world.physics.highest("paddle_speed")
    best, found, worlds = np.full(w, np.inf), Shots.none(w), np.arange(w)
    found.draw = middle.copy()
    each, beside = np.repeat(worlds, n), np.repeat(BESIDE / near, w * n)
    thrice = np.tile(each, len(BESIDE))
    many = Aim(
        aim.game,
        {name: rows[thrice] for name, rows in aim.goal.items()},
        {name: rows[thrice] for name, rows in aim.laws.items()},
    )
    for width in widths:
        off = width * np.ptp(RANGES, 1) * rng.uniform(-0.5, 0.5, (w, n, 3))
        draws = found.draw[:, None] + off
        x, angle, share = draws.reshape(-1, 3).T
        struck, wait = reached(falls, each, x)
        normal = np.stack([np.cos(angle), np.sin(angle)], -1)
        contact, velocity = struck[:, :2] - near * normal, top * share[:, None] * normal
        start = contact - RUN_UP * velocity
        legal = inside(world, contact, velocity) & inside(world, start, velocity)
        legal &= (wait > SOONEST) & (share > 0.0) & (share <= 1.0)
        hit = np.tile(struck, (len(BESIDE), 1))
        lean, push = (
            np.tile(angle, len(BESIDE)) + beside,
            np.tile(top * share, len(BESIDE)),
        )
        leans = np.stack([np.cos(lean), np.sin(lean)], -1)
        bounces = many.laws["paddle_restitution"], many.laws["paddle_friction"]
        hit_pucks(hit, leans, push, *bounces)
        missed = miss(roll(hit, STEP, STEPS, half, many.laws), many)
        score = missed.reshape(len(BESIDE), w, n).mean(0)
        score = np.where(legal.reshape(w, n), score, np.inf)
        first = score.argmin(-1)
        better = score[worlds, first] < best
        best[better] = score[worlds, first][better]
        chosen = (worlds * n + first)[better]
        found.draw[better] = draws.reshape(-1, 3)[chosen]
        found.contact[better], found.velocity[better] = (
            contact[chosen],
            velocity[chosen],
        )
        found.time[better] = wait[chosen]
    return found


def reached(falls: Array, rows: Array, x: Array) -> tuple[Array, Array]:
    """Return pucks (n, 5) when they fall to x (n,), and the times until then, s.

    Args:
        falls: Paths of the pucks (W, T, 5).
        rows: Index of a puck for each x (n,).
        x: Positions, m.
    """
    below = falls[rows, :, 0] <= x[:, None]
    moment = np.maximum(below.argmax(-1), 1)
    after, before = falls[rows, moment], falls[rows, moment - 1]
    part = (x - before[:, 0]) / np.minimum(after[:, 0] - before[:, 0], -1e-6)
    part = np.clip(part, 0.0, 1.0)
    wait = np.where(below.any(-1), STEP * (moment - 1 + part), -1.0)
    return before + part[:, None] * (after - before), wait
