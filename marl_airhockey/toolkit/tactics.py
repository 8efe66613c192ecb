"""Tactics of scripted drivers in games: prediction, aim and playing strength.

All arrays are in the ego frame of a seat, with one row for each of W worlds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.extrapolation import Walls, extrapolate_rows
from marl_airhockey.sim.core.geometry import length, products
from marl_airhockey.sim.core.laws import impulse
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array


class Skill(NamedTuple):
    """Skill of a scripted driver."""

    pace: float
    """Largest commanded speed, as a share of top speed."""
    lag: float
    """Time by which its predictions of pucks are late, s."""


STRENGTHS = {
    "weak": Skill(0.3, 0.15),
    "fair": Skill(0.55, 0.06),
    "strong": Skill(1.0, 0.0),
}
"""Skills by name."""


@dataclass
class Scripted(Driver):
    """Scripted driver with a selectable strength in games.

    Raises:
        ValueError: The strength is unknown.
    """

    strength: str = "strong"
    """Strength in games: "weak", "fair" or "strong"."""

    def __post_init__(self) -> None:
        if self.strength not in STRENGTHS:
            raise ValueError(unknown_name("strength", self.strength, STRENGTHS))
        self._skill = STRENGTHS[self.strength]

    def _paced(self, action: Array, view: View) -> Array:
        """Return velocities (W, 2), m/s, as shares of top speed, at most the pace."""
        share = action / view.top_speed[:, None]
        most = self._skill.pace / np.maximum(length(share), 1e-9)
        return share * np.minimum(most, 1.0)[:, None]


@dataclass(frozen=True)
class Field:
    """Field of a game in the ego frame of a seat: its edges and goals."""

    edge: float
    """x of the own side, m."""
    half: float
    """Largest |y| of a puck's centre, m; infinite on polygons."""
    keep: float
    """Largest |y| of a shot at the own goal, m."""
    targets: Array
    """Points in the goals of other teams (T, 2), m; empty if there are none."""
    walls: Walls
    """Walls for predictions."""

    @staticmethod
    @lru_cache(maxsize=64)
    def of(scene: Scene, seat: int) -> Field:
        """Return the field of a seat."""
        table, me = scene.table, scene.seats[seat]
        rotation = table.rotation(me.side)
        teams = {s.side: s.team for s in scene.seats}
        keep, points = np.inf, []
        for goal_line in scene.goal_lines:
            if goal_line.width is None:
                continue
            if teams.get(goal_line.side) == me.team:
                keep = goal_line.width / 2
                continue
            start, end = table.ends(goal_line.side)
            along = (end - start) / length(end - start)
            spread = max(goal_line.width / 2 - 1.2 * table.puck_radius, 0.0)
            middle = (start + end) / 2
            points += [middle + share * spread * along for share in (-1.0, 0.0, 1.0)]
        box = len(table.vertices) == 4 and me.side in (0, 2)
        half = float(table.size[1]) / 2 - table.puck_radius if box else np.inf
        targets = products(np.array(points).reshape(-1, 2), rotation)
        edge = -float(table.offsets[me.side])
        return Field(edge, half, keep, targets, Walls.of(scene).rotated(rotation))

    @property
    def sides(self) -> tuple[float, float, float]:
        """`half`, m, and restitution and friction of the long walls."""
        return self.half, self.walls.restitution, self.walls.friction


def nearest_puck(view: View, field: Field, lag: float) -> tuple[Array, Array]:
    """Predict the puck that is or will be nearest: position and velocity (W, 2).

    Pucks are extrapolated over the reaction time of the game minus ``lag``, s, see
    `extrapolation.extrapolate_rows`. With a longer lag they are moved back in a
    straight line.
    """
    place, motion = view.state.puck, view.state.puck_velocity
    ahead = view.reaction - lag
    if ahead > 0.0:
        place, motion = extrapolate_rows(place, motion, ahead, field.walls)
    else:
        place = place + ahead * motion
    which = (place[..., 0] + 0.4 * motion[..., 0]).argmin(-1)
    rows = np.arange(len(which))
    return place[rows, which], motion[rows, which]


def guard(view: View, field: Field, depth: float, lag: float) -> Array:
    """Return the points (W, 2), m, at which the puck crosses a line before the goal.

    Args:
        view: View of the seat.
        field: Field of the seat.
        depth: Distance of the line from the near edge of the workspace, m.
        lag: Time by which predictions of pucks are late, s.
    """
    line = view.reach[:, 0].min() + depth
    place, motion = nearest_puck(view, field, lag)
    due = np.clip((place[:, 0] - line) / np.maximum(-motion[:, 0], 0.3), 0.0, 0.6)
    wide = min(np.abs(view.reach[:, 1]).max(), field.keep)
    due = np.where(motion[:, 0] < 0.0, due, 0.0)
    aside = _slide_on(place, motion, due, *field.sides)[:, 1]
    return np.stack([np.full_like(aside, line), np.clip(aside, -wide, wide)], -1)


STEP, HORIZON = 0.05, 1.2
"""Time step and horizon of the prediction of a puck's path, s."""


@inner(error_model="numpy")
def _moved(
    x: float,
    y: float,
    vx: float,
    vy: float,
    time: float,
    half: float,
    restitution: float,
    friction: float,
) -> tuple[float, float]:
    """Return the position, m, of a puck without spin and drag after a time, s."""
    for _ in range(4):
        wall = half if vy > 0.0 else -half
        due = max((wall - y) / vy, 0.0) if vy != 0.0 else np.inf
        if due >= time:
            break
        x, y, time = x + vx * due, wall, time - due
        push = impulse(abs(vy), vx, restitution, friction, 1.0, 3.0)[1]
        vx, vy = vx + push, -restitution * vy
    return x + vx * time, y + vy * time


@compiled(error_model="numpy")
def _slide_on(
    place: Array,
    motion: Array,
    time: Array,
    half: float,
    restitution: float,
    friction: float,
) -> Array:
    """Return the positions (W, 2), m, of pucks after some times (W,), s."""
    out = np.empty_like(place)
    for w in range(len(out)):
        x, y, vx, vy = place[w, 0], place[w, 1], motion[w, 0], motion[w, 1]
        moved = _moved(x, y, vx, vy, time[w], half, restitution, friction)
        out[w, 0], out[w, 1] = moved
    return out


@compiled(error_model="numpy")
def _find_strike(
    place: Array,
    motion: Array,
    own: Array,
    speed: Array,
    aim: Array,
    low: Array,
    high: Array,
    touch: float,
    half: float,
    restitution: float,
    friction: float,
) -> tuple[Array, Array, Array]:
    """Find the first time at which a paddle can be behind a puck.

    Returns:
        Times (W,), s, infinite if there is none. Positions of the puck at this time,
        or now if there is none (W, 2), m. Unit vectors from there to the aim (W, 2).
    """
    due, there, way = np.empty(len(own)), np.empty_like(own), np.empty_like(own)
    for w in range(len(own)):
        due[w] = np.inf
        for moment in np.arange(0.0, HORIZON + 0.5 * STEP, STEP):
            x, y, vx, vy = place[w, 0], place[w, 1], motion[w, 0], motion[w, 1]
            x, y = _moved(x, y, vx, vy, moment, half, restitution, friction)
            ox, oy = aim[w, 0] - x, aim[w, 1] - y
            size = max(np.sqrt(ox * ox + oy * oy), 1e-6)
            ox, oy = ox / size, oy / size
            bx = min(max(x - ox * (touch + 0.03), low[0]), high[0]) - own[w, 0]
            by = min(max(y - oy * (touch + 0.03), low[1]), high[1]) - own[w, 1]
            needed = np.sqrt(bx * bx + by * by) / max(speed[w], 1e-6)
            fits = low[0] < x < high[0] + 0.7 * touch and needed <= moment + STEP
            if fits or moment == 0.0:
                there[w, 0], there[w, 1], way[w, 0], way[w, 1] = x, y, ox, oy
            if fits:
                due[w] = moment
                break
    return due, there, way


def attack(
    view: View, field: Field, aim: Array, pace: float, lag: float, shot: float = 1.0
) -> tuple[Array, Array]:
    """Compute velocities that strike the puck at a point.

    The puck is struck at the first time at which the paddle can be behind it. Until
    then the paddle waits a little behind this position.

    Args:
        view: View of the seat.
        field: Field of the seat.
        aim: Points to aim at (W, 2), m.
        pace: Largest speed, as a share of top speed.
        lag: Time by which predictions of pucks are late, s.
        shot: Speed of the strike, as a share of the largest speed.

    Returns:
        Velocities (W, 2), m/s, and times until the strike (W,), s, which are infinite
        if the puck cannot be struck.
    """
    own, speed = view.state.paddle[:, view.seat], pace * view.top_speed
    place, motion = nearest_puck(view, field, lag)
    bodies = view.state.bodies
    touch = bodies.radius[view.seat] + bodies.radius[bodies.paddles]
    low, high = view.reach.min(0), view.reach.max(0)

    due, there, way = _find_strike(
        place, motion, own, speed, aim, low, high, touch, *field.sides
    )
    contact = there - way * touch
    gap = contact - own
    along = (gap * way).sum(-1)
    aside = gap - along[:, None] * way
    rest = length(motion) < 0.3
    ready = (along > -0.01) & (along < 0.2) & (length(aside) < 0.02)
    strike = np.where(rest, ready, (due < 0.11) & (length(aside) < 0.06))
    through = way * (shot * speed)[:, None] + aside * 12.0
    # Move around the puck if it is nearer to home than the paddle.
    wrong = (own[:, 0] > there[:, 0] - 0.3 * touch) & (due < 0.25)
    room = np.where(own[:, 1] >= there[:, 1], 1.0, -1.0) * touch * 1.25
    detour = np.stack([there[:, 0] - 1.2 * touch, there[:, 1] + room], -1)
    target = np.where(wrong[:, None], np.clip(detour, low, high), contact - way * 0.05)
    action = np.where(strike[:, None], through, (target - own) * 12.0)
    return action, due


def open_goal(view: View, field: Field) -> Array:
    """Return the goal points (W, 2), m, whose shots pass farthest from paddles."""
    if not len(field.targets):
        return np.broadcast_to(np.array([-field.edge, 0.0]), (len(view.rng), 2))
    place, _ = nearest_puck(view, field, 0.0)
    others = np.delete(view.state.paddle, view.seat, axis=-2)
    shot = field.targets - place[:, None]
    size = np.maximum(length(shot), 1e-6)[..., None]
    gap = others[:, None] - place[:, None, None]
    along = np.clip((gap * (shot / size)[:, :, None]).sum(-1), 0.0, size)
    clear = length(gap - along[..., None] * (shot / size)[:, :, None]).min(-1)
    return np.asarray(field.targets[clear.argmax(-1)])
