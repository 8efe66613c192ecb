"""Kernel of the 2D table: one control step of B worlds in one compiled loop.

A world in which no contact can occur moves in one piece (`flight`). Any other world
moves from contact to contact (`event_loop`).
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends._planar.paddles import follow
from marl_airhockey.sim.backends.numba.arrays import (
    Batch,
    Commands,
    Previous,
    Result,
    Static,
)
from marl_airhockey.sim.backends.numba.bodies import BODY, CONTACT
from marl_airhockey.sim.backends.numba.event_loop import run_events
from marl_airhockey.sim.backends.numba.flight import block_space, fly_freely
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.types import Array


def work_space(static: Static, worlds: int) -> tuple[Array, Array]:
    """Return the work space of a kernel for B worlds.

    Each part of a batch uses one row. Unused rows take no memory.
    """
    movers = static.paddles + static.pucks + static.blocks
    walls = len(static.walls)
    size = movers * (movers + walls + len(static.obstacles))
    floats = movers * (BODY + 3) + CONTACT * size + static.walls.size
    return np.zeros((worlds, floats)), np.zeros((worlds, movers + 5 * size), np.int64)


@compiled(nogil=True, error_model="numpy")
def advance(
    paddles: int,
    pucks: int,
    blocks: int,
    radius: Array,
    walls: Array,
    wall_side: Array,
    goal_lines: Array,
    edges: int,
    obstacles: Array,
    control_dt: float,
    coefficients: Array,
    command: Array,
    prescribed: Array,
    closed: Array,
    above: Array,
    goal: Array,
    imposed: Array,
    raised: Array,
    previous_position: Array,
    previous_velocity: Array,
    previous_angle: Array,
    previous_spin: Array,
    previous_touching: Array,
    previous_time: Array,
    position: Array,
    velocity: Array,
    angle: Array,
    spin: Array,
    time: Array,
    touched: Array,
    touched_at: Array,
    touching: Array,
    banked: Array,
    crossed: Array,
    crossed_velocity: Array,
    lifted: Array,
    path: Array,
    against: Array,
    out: Array,
    pinned: Array,
    keys: Array,
    collisions: Array,
    work: Array,
    indices: Array,
) -> None:
    """Move B worlds by a control step, in place.

    Each array of a `Batch` is an argument of its own, because Python is slow to build
    tuples of arrays and numba is slow to unbox them. ``command``, ``prescribed``,
    ``closed`` and ``above`` are the arrays of a `contracts.backend.Command`. The three
    arguments that follow are filled.
    """
    static = Static(
        *(paddles, pucks, blocks, radius, walls, wall_side, goal_lines),
        *(edges, obstacles, control_dt),
    )
    ways = command, prescribed, above, previous_position
    follow(*ways, control_dt, goal, imposed, raised)
    commands = Commands(goal, imposed, raised, closed)
    previous = Previous(
        *(previous_position, previous_velocity, previous_angle, previous_spin),
        *(previous_touching, previous_time),
    )
    result = Result(
        *(position, velocity, angle, spin, time, touched, touched_at, touching),
        *(banked, crossed, crossed_velocity, lifted, path, against, out, pinned),
    )
    batch = Batch(static, coefficients, commands, previous, result, keys, collisions)
    active = np.empty(len(coefficients), np.bool_)
    blocked = block_space(paddles + pucks + blocks)
    if fly_freely(batch, active, blocked):
        run_events(batch, active, work, indices)
    for b in range(len(goal)):
        for i in range(paddles):
            if imposed[b, i]:
                velocity[b, i, 0] = prescribed[b, i, 2]
                velocity[b, i, 1] = prescribed[b, i, 3]
