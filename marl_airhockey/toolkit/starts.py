"""Samplers of start states that scenarios share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from marl_airhockey.sim.core.geometry import half_planes, length, products
from marl_airhockey.sim.core.laws import fly, impulse, wall_restitution
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.table import GRAVITY, Table
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.jit.elementary import sin
from marl_airhockey.types import Array

PADDLE_X = (-0.70, -0.60)
PADDLE_Y = (-0.10, 0.10)
"""Range of y in which a single paddle starts, unless the scenario sets it, m."""


def uniform_box(
    rng: RandomStreams, table: Table, x: tuple[float, float], y: tuple[float, float]
) -> Array:
    """Sample uniform points (W, 2), m, in a box of the standard table.

    `Table.from_standard` maps them to ``table``.
    """
    low, high = _corners(table, x, y)
    return rng.uniform(low, high, 2)


@cache
def _corners(
    table: Table, x: tuple[float, float], y: tuple[float, float]
) -> tuple[Array, Array]:
    low, high = table.from_standard(np.array([x, y]).T)
    return low, high


SPIN = 0.6
"""Largest speed of a puck's edge by spin at the start, as a share of its speed.

After a bounce on a professional table, half of the pucks had at most 0.09 and nine in
ten at most 0.44. On a wooden table these values are 0.59 and 0.83. The page on physics
of the documentation describes the data.
"""
FALLING = np.array([(0.4, 0.8), (-0.2, 0.2), (-1.0, -0.2), (-0.3, 0.3), (-SPIN, SPIN)])
"""Ranges of x, y, m, vx, vy, m/s, and edge speed / speed of a falling puck."""
HOME = np.array([PADDLE_X, PADDLE_Y, *FALLING])
"""Ranges of x and y of the paddle, m, followed by `FALLING`."""


@cache
def _home(table: Table) -> Array:
    """Return the lower and upper ends (2, 7) of `HOME` on a table."""
    ends = HOME.T.copy()
    for first in (0, 2):
        ends[:, first : first + 2] = table.from_standard(ends[:, first : first + 2])
    return ends


def falling_puck(rng: RandomStreams, table: Table) -> Array:
    """Sample pucks that fall from the far half.

    Returns:
        Pucks (W, 5): x and y, m, vx, vy and speed of the edge by spin, m/s.
    """
    puck = rng.uniform(*_home(table)[:, 2:], 5)
    _spin(puck)
    return puck


@compiled()
def _spin(puck: Array) -> None:
    """Multiply the last of five columns, a share of the speed, by the speed."""
    for w in range(len(puck)):
        puck[w, 4] *= math.sqrt(puck[w, 2] ** 2 + puck[w, 3] ** 2)


@compiled()
def _drop(
    puck: Array, body: int, position: Array, velocity: Array, edge: Array
) -> None:
    """Set a body of all worlds to the columns of `falling_puck`."""
    for w in range(len(puck)):
        position[w, body, 0], position[w, body, 1] = puck[w, 0], puck[w, 1]
        velocity[w, body, 0], velocity[w, body, 1] = puck[w, 2], puck[w, 3]
        edge[w, body] = puck[w, 4]


def falling(rng: RandomStreams, scene: Scene) -> State:
    """Sample states with one paddle at home and pucks that fall from the far half.

    Pucks do not overlap.
    """
    table, state = scene.table, scene.still_state(len(rng))
    draws = rng.uniform(*_home(table), 7)
    state.position[:, 0], puck = draws[:, :2], draws[:, 2:]
    _spin(puck)
    first, radius = scene.bodies.puck.start, table.puck_radius
    for k in range(first, scene.bodies.puck.stop):
        others = state.position[:, first:k]

        def apart(rows: Array, others: Array = others) -> Array:
            gap = length(rows[:, None, :2] - others)
            return np.asarray((gap > 3 * radius).all(-1))

        if k > first:
            puck = redraw(rng, lambda some: falling_puck(some, table), apart)
        _drop(puck, k, state.position, state.velocity, state.spin)
    state.spin[:, scene.bodies.puck] /= radius
    return state


def puck_gap(state: State) -> Array:
    """Return the distance from paddle 0 to puck 0 (W,), m."""
    return length(state.puck[:, 0] - state.paddle[:, 0])


def roll(
    start: Array,
    seconds: float,
    count: int,
    half: float,
    physics: Mapping[str, Array | float],
) -> Array:
    """Compute the paths of pucks that slide, fall and bounce off the long walls.

    Args:
        start: Pucks (W, 5): x and y, m, vx, vy and speed of the edge by spin, m/s.
        seconds: Time between two points of a path, s.
        count: Number of points T, including the start.
        half: Largest |y| of the puck's centre, m.
        physics: Physics parameters by name, one for all pucks or (W,).

    Returns:
        Paths (W, T, 5) with the columns of the start.
    """
    names = (
        *("puck_damping", "puck_drag", "wall_restitution", "wall_restitution_slope"),
        "wall_friction",
    )
    tilts = (np.radians(physics[name]) for name in ("tilt", "cross_tilt"))
    pulls = (-GRAVITY * sin(tilt) for tilt in tilts)
    columns = [*pulls, *(physics[name] for name in names)]
    laws = np.empty((len(start), len(columns)))
    for k, column in enumerate(columns):
        laws[:, k] = column
    out = np.empty((len(start), count, 5))
    _roll(start, seconds, half, laws, out)
    return out


@compiled(error_model="numpy")
def _roll(start: Array, h: float, half: float, laws: Array, out: Array) -> None:
    """Fill ``out`` (W, T, 5) for ``start`` (W, 5)."""
    for w in range(len(out)):
        gx, gy, damping, drag = laws[w, 0], laws[w, 1], laws[w, 2], laws[w, 3]
        restitution, slope, friction = laws[w, 4], laws[w, 5], laws[w, 6]
        x, y, vx, vy = start[w, 0], start[w, 1], start[w, 2], start[w, 3]
        edge = start[w, 4]
        for t in range(out.shape[1]):
            way, left = out[w, t], h
            way[0], way[1], way[2], way[3], way[4] = x, y, vx, vy, edge
            dx, dy, ex, ey = fly(vx, vy, h, gx, gy, damping, drag)
            if abs(y + dy) > half and vy * y > 0.0:
                # Move to the wall, bounce, and move for the remaining time.
                share = max((half - abs(y)) / abs(dy), 0.0)
                dx, dy, vx, vy = fly(vx, vy, share * h, gx, gy, damping, drag)
                x, y, left = x + dx, y + dy, (1.0 - share) * h
                # The tangent is the normal turned by +90 degrees.
                side = 1.0 if vy > 0.0 else -1.0
                e = wall_restitution(abs(vy), restitution, slope)
                push = impulse(abs(vy), side * vx - edge, e, friction, 1.0, 3.0)[1]
                vx, vy, edge = vx + side * push, -e * vy, edge - 2.0 * push
                dx, dy, ex, ey = fly(vx, vy, left, gx, gy, damping, drag)
            x, y, vx, vy = x + dx, y + dy, ex, ey


def inside(rng: RandomStreams, scene: Scene, seat: int, margin: float = 0.0) -> Array:
    """Sample points (W, 2), table frame, m, at least ``margin`` inside a workspace."""
    polygon = np.asarray(scene.seats[seat].reach)
    normals, offsets = half_planes(scene.seats[seat].reach)
    low, high = polygon.min(0) + margin, polygon.max(0) - margin

    def sample(some: RandomStreams) -> Array:
        return some.uniform(low, high, 2)

    def fits(points: Array) -> Array:
        return np.asarray((products(points, normals) + offsets >= margin).all(-1))

    ego = redraw(rng, sample, fits)
    return products(ego, scene.table.rotation(scene.seats[seat].side).T)


NARROW_TRIES = 50
"""Number of samples from narrowed ranges before full ranges are used."""


def redraw(
    rng: RandomStreams,
    sample: Callable[[RandomStreams], Array],
    accept: Callable[[Array], Array],
) -> Array:
    """Sample rows, each again until ``accept`` is True for it.

    A row that is not found in narrowed ranges (`RandomStreams.spread`) is sampled from
    full ranges.

    Raises:
        RuntimeError: A row is not accepted in 1000 tries.
    """
    rows = sample(rng)
    for k in range(1000):
        again = np.flatnonzero(~accept(rows))
        if not len(again):
            return rows
        some = rng.select(again)
        some.spread = some.spread if k < NARROW_TRIES else 1.0
        rows[again] = sample(some)
    raise RuntimeError(
        "start: found no valid start state in 1000 tries; use fewer bodies"
    )
