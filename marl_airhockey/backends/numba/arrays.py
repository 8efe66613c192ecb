"""Arrays of the kernel: table, commands, motion, events, coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.types import Array

FALL, FADE, FLIGHT_FADE, FLIGHT_FALL, FLIGHT_DISTANCE, FLIGHT_DROP = range(6)
WALL, PADDLE, BLOCK, PUCK_MASS, BLOCK_MASS, FRICTION = range(6, 12)
COEFFICIENTS = 12
"""Columns of a world's coefficients: speed that a substep takes from a puck's vx (m/s)
and share of its speed that it leaves (1); the same for a whole step, and the distance
(s, times the speed) and drop (m) in it; restitutions, masses (kg) and speed that
friction takes from a block in a substep (m/s)."""


def make_coefficients(
    values: dict[str, Array], control_dt: float, substeps: int
) -> Array:
    """Return (B, COEFFICIENTS) from physical parameters (B,); `pull` in m/s2."""
    dt = control_dt / substeps
    fall, fade = values["pull"] * dt, np.exp(-values["puck_damping"] * dt)
    # x and v are linear in the initial v: sum the substeps with v = 1 and v = 0.
    speed, drop = np.ones_like(fall), np.zeros_like(fall)
    distance, lost = np.zeros_like(fall), np.zeros_like(fall)
    for _ in range(substeps):
        distance, lost = distance + speed * dt, lost + drop * dt
        speed, drop = speed * fade, drop * fade - fall
    names = ("wall_restitution", "paddle_restitution", "block_restitution")
    rest = [values[n] for n in (*names, "puck_mass", "block_mass")]
    friction = values["block_friction"] * dt
    return np.stack([fall, fade, speed, drop, distance, lost, *rest, friction], axis=-1)


class Static(NamedTuple):
    """Static side that all worlds of a batch share."""

    paddles: int
    pucks: int
    blocks: int
    radius: Array
    """Radii of the bodies (N,), m"""
    lines: Array
    """Result of `walls.sides`"""
    goal_lines: Array
    """Side of each goal line, and 1 if it is that whole side (M, 2)"""
    obstacles: Array
    """Obstacles (O, 5): see `contacts.contact_obstacle`"""
    control_dt: float
    """Length of a control step, s"""
    substeps: int


class Commands(NamedTuple):
    """Commands to the paddles of B worlds in a step."""

    goal: Array
    """Velocity at the end of the step, or during all of it if prescribed
    (B, paddles, 2), m/s"""
    prescribed: Array
    """True if the paddle moves at its velocity and does not yield (B, paddles)"""
    lifted: Array
    """True if the paddle touches nothing (B, paddles)"""
    closed: Array
    """True if the goal line is wall (B, M)"""


class Previous(NamedTuple):
    """State before the step, read-only."""

    position: Array
    """(B, N, 2) m"""
    velocity: Array
    """(B, N, 2) m/s"""
    touching: Array
    """True if in contact (B, paddles, pucks)"""
    time: Array
    """(B,) s"""


class Motion(NamedTuple):
    """Motion of all bodies, filled; `push` persists between steps."""

    position: Array
    """(B, N, 2) m"""
    velocity: Array
    """(B, N, 2) m/s"""
    path: Array
    """Columns x, y, vx, vy (B, substeps + 1, movers, 4), or (B, 0, movers, 4) if the
    scene does not require it"""
    push: Array
    """Correction of overlaps that the next substep applies (B, movers, 2), m"""
    time: Array
    """(B,) s"""


class Events(NamedTuple):
    """Events of pucks, filled; the last two persist between steps."""

    touched: Array
    """Contacts (B, paddles, pucks); this and the next five as in `State`"""
    touched_at: Array
    touching: Array
    banked: Array
    crossed: Array
    crossed_velocity: Array
    against: Array
    """True if the puck touches the wall of that side (B, pucks, sides)"""
    out: Array
    """True if the puck is out of play (B, pucks)"""


class Batch(NamedTuple):
    """Batch of B worlds: all arrays of the kernel."""

    static: Static
    coefficients: Array
    """Coefficients of the laws (B, COEFFICIENTS)"""
    commands: Commands
    previous: Previous
    motion: Motion
    events: Events
