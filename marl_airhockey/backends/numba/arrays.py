"""Arrays that the kernel works on: table, commands, motion, events, coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.types import Array

FALL, FADE, FLIGHT_FADE, FLIGHT_FALL, FLIGHT_DISTANCE, FLIGHT_DROP = range(6)
WALL, PADDLE, BLOCK, PUCK_MASS, BLOCK_MASS, GRIP = range(6, 12)
COEFFICIENTS = 12
"""Columns of a world's coefficients: speed that a substep takes from a puck's vx (m/s)
and share of its speed that it leaves (1); the same for a whole step, and the distance
(s, times the speed) and drop (m) in it; restitutions, masses (kg) and speed that
friction takes from a block in a substep (m/s)."""


def make_coefficients(
    values: dict[str, Array], control_dt: float, substeps: int
) -> Array:
    """Return (B, COEFFICIENTS) from physical parameters, (B,) each; pull in m/s2."""
    dt = control_dt / substeps
    fall, fade = values["pull"] * dt, np.exp(-values["puck_damping"] * dt)
    # x and v are linear in the first v: the sums of substeps with v = 1 and v = 0.
    speed, drop = np.ones_like(fall), np.zeros_like(fall)
    distance, lost = np.zeros_like(fall), np.zeros_like(fall)
    for _ in range(substeps):
        distance, lost = distance + speed * dt, lost + drop * dt
        speed, drop = speed * fade, drop * fade - fall
    names = ("wall_restitution", "paddle_restitution", "block_restitution")
    rest = [values[n] for n in (*names, "puck_mass", "block_mass")]
    grip = values["block_friction"] * dt
    return np.stack([fall, fade, speed, drop, distance, lost, *rest, grip], axis=-1)


class Static(NamedTuple):
    """Static side that all worlds of a batch share."""

    paddles: int
    pucks: int
    blocks: int
    radius: Array
    """(N,) m"""
    lines: Array
    """`walls.sides`"""
    goal_lines: Array
    """(M, 2) side of each goal line, and 1 if it is that whole side"""
    obstacles: Array
    """(O, 5) see `contacts.contact_obstacle`"""
    control_dt: float
    """s"""
    substeps: int


class Commands(NamedTuple):
    """Commands to the paddles of B worlds in a step."""

    goal: Array
    """(B, paddles, 2) m/s at the end of the step; of a prescribed one, all along"""
    prescribed: Array
    """(B, paddles) moves at its velocity and does not yield"""
    lifted: Array
    """(B, paddles) touches nothing"""
    closed: Array
    """(B, M) goal lines that are wall"""


class Previous(NamedTuple):
    """State that a step begins with, read-only."""

    position: Array
    """(B, N, 2) m"""
    velocity: Array
    """(B, N, 2) m/s"""
    touching: Array
    """(B, paddles, pucks) see `State`"""
    time: Array
    """(B,) s"""


class Motion(NamedTuple):
    """Motion of all bodies, filled; `push` is kept from step to step."""

    position: Array
    """(B, N, 2) m"""
    velocity: Array
    """(B, N, 2) m/s"""
    path: Array
    """(B, substeps + 1, movers, 4) x, y, vx, vy, or (B, 0, movers, 4) if not wanted"""
    push: Array
    """(B, movers, 2) m: correction of overlaps that the next substep applies"""
    time: Array
    """(B,) s"""


class Events(NamedTuple):
    """Events of pucks, filled; the last two are kept from step to step."""

    touched: Array
    """(B, paddles, pucks) see `State`, as the next five"""
    touched_at: Array
    touching: Array
    banked: Array
    crossed: Array
    crossed_velocity: Array
    against: Array
    """(B, pucks, sides) bool: the puck touches the wall of that side"""
    out: Array
    """(B, pucks) bool: the puck is out of play"""


class Batch(NamedTuple):
    """B worlds: all arrays that the kernel works on."""

    static: Static
    coefficients: Array
    """(B, LAWS)"""
    commands: Commands
    previous: Previous
    motion: Motion
    events: Events
