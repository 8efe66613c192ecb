"""Arrays of the kernel: table, commands, states, events and coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.parameters import SCATTER
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import reaches
from marl_airhockey.sim.core.table import GRAVITY
from marl_airhockey.sim.jit.elementary import expm1, hypot, sin
from marl_airhockey.types import Array

PULL_X, PULL_Y, DAMPING, DRAG = range(4)
WALL_E, WALL_SLOPE, WALL_MU, PADDLE_E, PADDLE_MU = range(4, 9)
PUCK_E, PUCK_MU, BLOCK_E = range(9, 12)
PUCK_MASS, BLOCK_MASS, BLOCK_GRIP, PULL, STEP_TIME = range(12, 17)
WALL_E_SD, WALL_EXIT_SD, PADDLE_E_SD, SPIN_SD = range(17, 21)
COEFFICIENTS = 21
"""Columns of a world's coefficients.

- Acceleration by the slope along x and y (m/s2), linear drag (1/s), quadratic drag
  (1/m).
- Walls: restitution, its loss per ln(m/s), friction.
- Paddles: restitution, friction. Pucks: restitution, friction. Blocks: restitution.
- Masses of pucks and blocks (kg), deceleration of sliding blocks by friction (m/s2),
  and norm of the acceleration by the slope (m/s2).
- Time in which a puck without linear drag travels as far as in a control step with it
  (s).
- Standard deviations of the contact noise, see `core.scatter`.
"""


def make_coefficients(values: dict[str, Array], control_dt: float) -> Array:
    """Return coefficients (B, COEFFICIENTS) from physical parameters (B,) by name."""
    names = (
        *("puck_damping", "puck_drag", "wall_restitution", "wall_restitution_slope"),
        *("wall_friction", "paddle_restitution", "paddle_friction"),
        *("puck_restitution", "puck_friction", "block_restitution"),
        *("puck_mass", "block_mass", "block_friction"),
    )
    pull_x = -GRAVITY * sin(np.radians(values["tilt"]))
    pull_y = -GRAVITY * sin(np.radians(values["cross_tilt"]))
    damping = values["puck_damping"]
    time = -expm1(-damping * control_dt) / np.maximum(damping, 1e-300)
    time = np.where(damping > 0.0, time, control_dt)
    columns = [pull_x, pull_y, *(values[n] for n in names)]
    columns += [hypot(pull_x, pull_y), time]
    columns += [values[name] for name in SCATTER]
    return np.stack(columns, axis=-1)


NORMAL_X, NORMAL_Y, OFFSET, MIDDLE_X, MIDDLE_Y, SIGN, HALF = range(7)
"""Columns of a wall: inward normal, distance of its line from the origin (m), middle of
its side (m), and two columns for the part of the line that is wall. A point of the line
is wall if its signed distance from the middle, times ``SIGN``, is at least ``HALF``
(m). ``HALF`` is -inf if the whole line is wall."""


def make_walls(scene: Scene) -> tuple[Array, Array, Array, int]:
    """Return the walls of a scene: one for each side, or two next to an open goal line.

    The first walls are the edges of the workspaces, E for each of the S seats. An edge
    limits only the paddle of its seat. The other F walls are sides of the table.

    Returns:
        Four values: walls (S E + F, 7); side of each wall, -1 for edges (S E + F,); for
        each goal line its side and the index of the first of its two walls, -1 if the
        line is a whole side (M, 2); and E.
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
    """Static values that all worlds of a batch share."""

    paddles: int
    pucks: int
    blocks: int
    radius: Array
    """Radii of the bodies (N,), m."""
    walls: Array
    """Walls (S E + F, 7); `make_walls` returns this field and the next three."""
    wall_side: Array
    goal_lines: Array
    edges: int
    obstacles: Array
    """Obstacles (O, 5): x, y of both ends of a segment, and the radius around it, m."""
    control_dt: float
    """Length of a control step, s."""


class Commands(NamedTuple):
    """Commands to the paddles of B worlds in a step."""

    goal: Array
    """Velocities at the end of the step; during the whole step if position-driven
    (B, paddles, 2), table frame, m/s."""
    prescribed: Array
    """True for position-driven paddles, which do not yield (B, paddles)."""
    raised: Array
    """True for paddles that touch nothing (B, paddles)."""
    closed: Array
    """True for goal lines that are wall (B, M)."""


class Previous(NamedTuple):
    """State before the step, read-only; the names are those of `State`."""

    position: Array
    velocity: Array
    angle: Array
    spin: Array
    touching: Array
    time: Array


class Result(NamedTuple):
    """State after the step, filled; `State` defines all names but the last three."""

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
    """Columns x, y, vx, vy (B, moments + 1, movers, 4); (B, 0, movers, 4) if the scene
    does not require a path."""
    against: Array
    """True if the puck touches the wall of the side (B, pucks, sides); persists."""
    out: Array
    """True for pucks out of play (B, pucks); persists."""
    pinned: Array
    """Time for which a position-driven paddle has pinned the puck (B, pucks), s;
    persists."""


class Batch(NamedTuple):
    """Batch of B worlds: all arrays of the kernel."""

    static: Static
    coefficients: Array
    """Coefficients of the physics (B, COEFFICIENTS)."""
    commands: Commands
    previous: Previous
    result: Result
    keys: Array
    """Keys of the contact noise of the worlds (B,)."""
    collisions: Array
    """Number of collisions since the key was set (B,)."""
