"""Arrays of the kernel: table, commands, motion, events, coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.parameters import SCATTER
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import reaches
from marl_airhockey.sim.core.table import GRAVITY
from marl_airhockey.types import Array

PULL_X, PULL_Y, DAMPING, DRAG = range(4)
WALL_E, WALL_SLOPE, WALL_MU, PADDLE_E, PADDLE_MU = range(4, 9)
PUCK_E, PUCK_MU, BLOCK_E = range(9, 12)
PUCK_MASS, BLOCK_MASS, BLOCK_GRIP, PULL, STEP_TIME = range(12, 17)
WALL_E_SD, WALL_EXIT_SD, PADDLE_E_SD, SPIN_SD = range(17, 21)
COEFFICIENTS = 21
"""Columns of a world's coefficients: acceleration by the slope (m/s2), linear (1/s) and
quadratic drag (1/m); restitution at walls, its loss per ln(m/s), and friction there;
restitutions and frictions of paddles and pucks, restitution of blocks; masses (kg),
deceleration of sliding blocks, the size of the slope's acceleration (m/s2), and the
time without linear drag for the way that a puck goes in a control step with it (s);
and the scatter of `core.scatter`."""


def make_coefficients(values: dict[str, Array], control_dt: float) -> Array:
    """Return (B, COEFFICIENTS) from physical parameters (B,)."""
    names = (
        *("puck_damping", "puck_drag", "wall_restitution", "wall_restitution_slope"),
        *("wall_friction", "paddle_restitution", "paddle_friction"),
        *("puck_restitution", "puck_friction", "block_restitution"),
        *("puck_mass", "block_mass", "block_friction"),
    )
    pull_x = -GRAVITY * np.sin(np.radians(values["tilt"]))
    pull_y = -GRAVITY * np.sin(np.radians(values["cross_tilt"]))
    damping = values["puck_damping"]
    time = -np.expm1(-damping * control_dt) / np.maximum(damping, 1e-300)
    time = np.where(damping > 0.0, time, control_dt)
    columns = [pull_x, pull_y, *(values[n] for n in names)]
    columns += [np.hypot(pull_x, pull_y), time]
    columns += [values[name] for name in SCATTER]
    return np.stack(columns, axis=-1)


NORMAL_X, NORMAL_Y, OFFSET, MIDDLE_X, MIDDLE_Y, SIGN, HALF = range(7)
"""Columns of a wall: inward normal, distance of its line from the origin (m), middle of
its side (m), and the part of the line that is wall: where the distance along it from
the middle, times ``SIGN``, is at least ``HALF`` (m; -inf for all of the line)."""


def make_walls(scene: Scene) -> tuple[Array, Array, Array, int]:
    """Return the walls of a scene: one per side, or two beside an open goal line.

    The edges of the seats' reaches come first, E of each seat, which hold its paddle
    alone.

    Returns:
        Walls (S E + F, 7), the sides that they belong to (S E + F,), -1 for edges, for
        each goal line (M, 2) its side and the first of its two walls, -1 where the line
        is a whole side, and E.
    """
    table = scene.table
    normals, offsets = reaches(table, scene.seats)
    rows: list[list[float]] = []
    for normal, offset in zip(normals.reshape(-1, 2), offsets.ravel(), strict=True):
        rows.append([*normal, offset + table.paddle_radius, 0.0, 0.0, 1.0, -np.inf])
    owner = [-1] * len(rows)
    lines = np.full((len(scene.goal_lines), 2), -1, np.int64)
    for side in range(len(table.vertices)):
        start, end = table.ends(side)
        line = [*table.normals[side], table.offsets[side], *(start + end) / 2]
        widths = [m.width for m in scene.goal_lines if m.side == side and m.width]
        for m, goal_line in enumerate(scene.goal_lines):
            if goal_line.side == side:
                lines[m] = side, len(rows) if goal_line.width else -1
        ends = [(1.0, max(widths) / 2), (-1.0, max(widths) / 2)] if widths else []
        for part in ends or [(1.0, -np.inf)]:
            rows.append([*line, *part])
            owner.append(side)
    return np.array(rows), np.array(owner), lines, normals.shape[1]


class Static(NamedTuple):
    """Static side that all worlds of a batch share."""

    paddles: int
    pucks: int
    blocks: int
    radius: Array
    """Radii of the bodies (N,), m"""
    walls: Array
    """Walls (S E + F, 7): see `make_walls`, like the next three"""
    wall_side: Array
    goal_lines: Array
    edges: int
    obstacles: Array
    """Obstacles (O, 5): x, y of both ends of a segment, and the radius around it, m"""
    control_dt: float
    """Length of a control step, s"""


class Commands(NamedTuple):
    """Commands to the paddles of B worlds in a step."""

    goal: Array
    """Velocity at the end of the step, or during all of it if prescribed
    (B, paddles, 2), m/s"""
    prescribed: Array
    """True if the paddle moves at its velocity and does not yield (B, paddles)"""
    raised: Array
    """True if the paddle touches nothing (B, paddles)"""
    closed: Array
    """True if the goal line is wall (B, M)"""


class Previous(NamedTuple):
    """State before the step, read-only; names as in `State`."""

    position: Array
    velocity: Array
    angle: Array
    spin: Array
    touching: Array
    time: Array


class Result(NamedTuple):
    """State after the step, filled; names as in `State`, but for the last three."""

    position: Array
    velocity: Array
    angle: Array
    spin: Array
    time: Array
    touched: Array
    touched_at: Array
    touching: Array
    banked: Array
    crossed: Array
    crossed_velocity: Array
    lifted: Array
    path: Array
    """Columns x, y, vx, vy (B, moments + 1, movers, 4), or (B, 0, movers, 4) if the
    scene does not require it"""
    against: Array
    """True if the puck touches the wall of that side (B, pucks, sides); persists"""
    out: Array
    """True if the puck is out of play (B, pucks); persists"""
    pinned: Array
    """Time for which a prescribed paddle has left the puck no room (B, pucks), s;
    persists"""


class Batch(NamedTuple):
    """Batch of B worlds: all arrays of the kernel."""

    static: Static
    coefficients: Array
    """Coefficients of the laws (B, COEFFICIENTS)"""
    commands: Commands
    previous: Previous
    result: Result
    keys: Array
    """Keys of the worlds' scatter (B,)"""
    collisions: Array
    """Number of collisions since they were set (B,)"""
