"""Samplers of initial states that scenarios share."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from marl_airhockey.core.geometry import half_planes
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.types import Array

PADDLE_X = (-0.70, -0.60)
PADDLE_Y = (-0.10, 0.10)
"""Range of y at which a single paddle starts unless its scenario sets it (m)."""


def uniform_box(
    rng: RandomStreams, x: tuple[float, float], y: tuple[float, float]
) -> Array:
    """(W, 2) uniform points in a box of the standard table, m."""
    low, high = _corners(x, y)
    return rng.uniform(low, high, 2)


@cache
def _corners(x: tuple[float, float], y: tuple[float, float]) -> tuple[Array, Array]:
    low, high = np.array([x, y]).T
    return low, high


def falling_puck(rng: RandomStreams) -> tuple[Array, Array]:
    """Draw position and velocity (W, 2) of a puck that falls from the far half."""
    position = uniform_box(rng, (0.4, 0.8), (-0.2, 0.2))
    velocity = uniform_box(rng, (-1.0, -0.2), (-0.3, 0.3))
    return position, velocity


def falling(rng: RandomStreams, scene: Scene) -> State:
    """Draw states with one paddle at home and pucks that fall from the far half.

    No puck overlaps another.
    """
    state = scene.still_state(len(rng))
    state.position[:, 0] = uniform_box(rng, PADDLE_X, PADDLE_Y)
    first = scene.bodies.puck.start
    for k in range(first, scene.bodies.puck.stop):
        others = state.position[:, first:k]

        def apart(rows: Array, others: Array = others) -> Array:
            gap = np.linalg.norm(rows[:, None, 0] - others, axis=-1)
            return np.asarray((gap > 3 * scene.table.puck_radius).all(-1))

        if k == first:
            state.position[:, k], state.velocity[:, k] = falling_puck(rng)
            continue
        puck = redraw(rng, lambda some: np.stack(falling_puck(some), 1), apart)
        state.position[:, k], state.velocity[:, k] = puck[:, 0], puck[:, 1]
    return state


def serve(
    rng: RandomStreams,
    state: State,
    puck: int,
    heading: Array,
    rows: Array | None = None,
) -> None:
    """Place a puck at the centre, moving at 0.5 m/s within 0.3 rad of a heading.

    The state is changed in place, but for its paddles. Several pucks are placed beside
    each other. Where a paddle or another puck is in the way, the puck is placed at the
    nearest free point of the middle line.

    Args:
        rng: one stream per row.
        state: rows (W,).
        puck: its index.
        heading: (W,) or (), rad in the table frame.
        rows: (W,) bool: True for the rows to serve; None for all.
    """
    angle = heading + rng.uniform(-0.3, 0.3)
    place = _free_place(state, puck)
    motion = 0.5 * np.stack([np.cos(angle), np.sin(angle)], -1)
    some = slice(None) if rows is None else rows
    state.puck[some, puck], state.puck_velocity[some, puck] = place[some], motion[some]
    state.spin[some, state.bodies.puck.start + puck] = 0.0
    state.touching[some, :, puck] = False


SIDESTEPS = 0.02 * np.array([0, *(s * k for k in range(1, 13) for s in (1, -1))])
"""Distances along the middle line, from where a puck should be served, m."""


def _free_place(state: State, puck: int) -> Array:
    """(W, 2) points of the middle line that no paddle or other puck covers, m."""
    bodies = state.bodies
    first = 0.12 * (puck - 0.5 * (bodies.pucks - 1))
    places = np.stack([np.zeros_like(SIDESTEPS), first + SIDESTEPS], -1)
    others = [i for i in range(bodies.puck.stop) if i != bodies.puck.start + puck]
    radius = np.array(bodies.radius)
    touch = radius[others] + radius[bodies.puck.start] + 0.005
    gap = state.position[:, None, others] - places[:, None]
    free = (np.hypot(gap[..., 0], gap[..., 1]) > touch).all(-1)
    return np.asarray(places[free.argmax(-1)])


def puck_gap(state: State) -> Array:
    """(W,) distance of paddle 0 to puck 0, m."""
    gap = state.puck[:, 0] - state.paddle[:, 0]
    return np.asarray(np.hypot(gap[:, 0], gap[:, 1]))


def roll(
    position: Array,
    velocity: Array,
    times: Array,
    pull: float,
    damping: float,
    half_width: float,
    restitution: float,
) -> Array:
    """Compute, in closed form, a puck that slides, falls and banks off the long walls.

    With drag c the lateral distance after time t is that of a puck without drag after
    u = (1 - exp(-c t)) / c, so that banks happen at known u.

    Args:
        position: (W, 2) m.
        velocity: (W, 2) m/s.
        times: (T,) s, ascending.
        pull: acceleration toward home, m/s2.
        damping: drag c, 1/s, above 0.
        half_width: largest |y| of the puck's centre, m.
        restitution: restitution of the walls.

    Returns:
        (W, T, 4) x, y, vx, vy.
    """
    out = np.empty((len(position), len(times), 4))
    fade = np.exp(-damping * times)
    start = np.concatenate([position, velocity], -1)
    _roll(start, times, fade, pull / damping, damping, half_width, restitution, out)
    return out


@njit(cache=True, error_model="numpy")
def _roll(
    start: Array,
    times: Array,
    fade: Array,
    fall: float,
    damping: float,
    half_width: float,
    restitution: float,
    out: Array,
) -> None:
    """Fill ``out`` (W, T, 4) for ``start`` (W, 4); ``fall`` is the terminal speed."""
    for w in range(len(start)):
        x, y, vx, vy = start[w, 0], start[w, 1], start[w, 2], start[w, 3]
        side = -1.0 if vy < 0.0 else 1.0
        speed, last, edge = max(abs(vy), 1e-9), 0.0, y
        bank = (half_width - side * y) / speed
        for t in range(len(times)):
            u = (1.0 - fade[t]) / damping
            while u >= bank and speed > 1e-9:
                edge, last = side * half_width, bank
                speed, side = speed * restitution, -side
                bank += 2.0 * half_width / max(speed, 1e-9)
            out[w, t, 0] = x + (vx + fall) * u - fall * times[t]
            out[w, t, 1] = edge + side * speed * (u - last)
            out[w, t, 2] = (vx + fall) * fade[t] - fall
            out[w, t, 3] = side * speed * fade[t]


def inside(rng: RandomStreams, scene: Scene, seat: int, margin: float = 0.0) -> Array:
    """(W, 2) points in a seat's reach, ``margin`` m from its edges, table frame, m."""
    polygon = np.asarray(scene.seats[seat].reach)
    normals, offsets = half_planes(scene.seats[seat].reach)
    low, high = polygon.min(0) + margin, polygon.max(0) - margin

    def sample(some: RandomStreams) -> Array:
        return some.uniform(low, high, 2)

    def fits(points: Array) -> Array:
        return np.asarray((points @ normals.T + offsets >= margin).all(-1))

    ego = redraw(rng, sample, fits)
    return np.asarray(ego @ scene.table.rotation(scene.seats[seat].side))


def redraw(
    rng: RandomStreams,
    sample: Callable[[RandomStreams], Array],
    accept: Callable[[Array], Array],
) -> Array:
    """Draw rows by ``sample``, each again until ``accept`` is True for it.

    Raises:
        RuntimeError: a row that is not accepted in 1000 tries.
    """
    rows = sample(rng)
    for _ in range(1000):
        again = np.flatnonzero(~accept(rows))
        if not len(again):
            return rows
        rows[again] = sample(rng.select(again))
    raise RuntimeError("start: no acceptable first state in 1000 tries")
