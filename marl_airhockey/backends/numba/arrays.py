"""What the kernel works on: the table, orders, motion, events, and the laws."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.types import Array

FALL, FADE, COAST_FADE, COAST_FALL, COAST_WAY, COAST_DROP = range(6)
WALL, PADDLE, BLOCK, PUCK_MASS, BLOCK_MASS, GRIP = range(6, 12)
LAWS = 12
"""Columns of a world's laws: what a substep takes from a puck's vx (m/s) and leaves of
its speed (1); the same for a whole step and its way (s) and drop (m); restitutions,
masses (kg) and what friction takes from a block in a substep (m/s)."""


def laws(values: dict[str, Array], control_dt: float, substeps: int) -> Array:
    """(B, LAWS) from physical parameters (B,) each, ``pull`` (m/s2) among them."""
    dt = control_dt / substeps
    fall, fade = values["pull"] * dt, np.exp(-values["puck_damping"] * dt)
    # x and v are linear in the first v: the sums of substeps with v = 1 and v = 0.
    speed, drop = np.ones_like(fall), np.zeros_like(fall)
    way, lost = np.zeros_like(fall), np.zeros_like(fall)
    for _ in range(substeps):
        way, lost = way + speed * dt, lost + drop * dt
        speed, drop = speed * fade, drop * fade - fall
    names = ("wall_restitution", "paddle_restitution", "block_restitution")
    rest = [values[n] for n in (*names, "puck_mass", "block_mass")]
    grip = values["block_friction"] * dt
    return np.stack([fall, fade, speed, drop, way, lost, *rest, grip], axis=-1)


class Ground(NamedTuple):
    """What all worlds of a batch share."""

    paddles: int
    pucks: int
    blocks: int
    radius: Array
    """(N,) m"""
    lines: Array
    """`rails.sides`"""
    goal_lines: Array
    """(M, 2) side of each goal line, and 1 if it is that whole side"""
    obstacles: Array
    """(O, 5) see `discs.meet_obstacle`"""
    control_dt: float
    """s"""
    substeps: int


class Order(NamedTuple):
    """What the paddles of B worlds do in a step."""

    goal: Array
    """(B, paddles, 2) m/s at the end of the step; of a prescribed one, all along"""
    prescribed: Array
    """(B, paddles) moves at its velocity and does not yield"""
    lifted: Array
    """(B, paddles) touches nothing"""
    closed: Array
    """(B, M) goal lines that are wall"""


class Last(NamedTuple):
    """What a step begins with: not changed."""

    position: Array
    """(B, N, 2) m"""
    velocity: Array
    """(B, N, 2) m/s"""
    touching: Array
    """(B, paddles, pucks) see `State`"""
    time: Array
    """(B,) s"""


class Motion(NamedTuple):
    """Where everything gets to; `push` is kept from step to step."""

    position: Array
    """(B, N, 2) m"""
    velocity: Array
    """(B, N, 2) m/s"""
    path: Array
    """(B, substeps + 1, movers, 4) x, y, vx, vy, or (B, 0, movers, 4) if not wanted"""
    push: Array
    """(B, movers, 2) m: what the next substep takes back of overlaps"""
    time: Array
    """(B,) s"""


class Events(NamedTuple):
    """What happened to pucks; the last two are kept from step to step."""

    touched: Array
    """(B, paddles, pucks) see `State`, as the next four"""
    touched_at: Array
    touching: Array
    crossed: Array
    crossed_velocity: Array
    leaning: Array
    """(B, pucks, M) whether a puck touches the wall that is a goal line"""
    out: Array
    """(B, pucks) whether a puck is out of play"""


class Batch(NamedTuple):
    """B worlds: all that the kernel works on."""

    ground: Ground
    law: Array
    """(B, LAWS)"""
    order: Order
    last: Last
    motion: Motion
    events: Events
