"""Worlds in which nothing can meet within a control step, and their closed form."""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.batch import (
    COAST_DROP,
    COAST_FADE,
    COAST_FALL,
    COAST_WAY,
    FALL,
    GRIP,
    Events,
    Ground,
    Motion,
    Order,
)
from marl_airhockey.discs import meet_obstacle
from marl_airhockey.state import Array


@njit(cache=True, nogil=True, error_model="numpy")
def find_busy(
    ground: Ground,
    law: Array,
    order: Order,
    motion: Motion,
    events: Events,
    busy: Array,
) -> None:
    """In which worlds bodies may meet anything within the step.

    A body stays within a disc about its place, of the way that it can go at most.
    """
    paddles, pucks, blocks, radius, lines, _, obstacles, control_dt, n = ground
    position, velocity, _, push = motion
    goal, out = order.goal, events.out
    first, movers = paddles + pucks, paddles + pucks + blocks
    way = np.zeros(movers)
    for b in range(len(law)):
        met, fall = False, law[b, FALL] * n
        for i in range(movers):
            vx, vy = velocity[b, i, 0], velocity[b, i, 1]
            most, extra = vx * vx + vy * vy, 0.0
            if i < paddles:
                gx, gy = goal[b, i, 0], goal[b, i, 1]
                most = max(most, gx * gx + gy * gy)
            elif i < first:
                # A puck out of play meets nothing.
                extra = -np.inf if out[b, i - paddles] else fall
            else:
                met |= most > 0.0 or law[b, FALL] > law[b, GRIP]
                met |= push[b, i, 0] != 0.0 or push[b, i, 1] != 0.0
            way[i] = radius[i] + (np.sqrt(most) + extra) * control_dt
        for i in range(paddles, first):
            x, y = position[b, i, 0], position[b, i, 1]
            for s in range(len(lines)):
                met |= lines[s, 0] * x + lines[s, 1] * y + lines[s, 2] < way[i]
            for o in range(len(obstacles)):
                met |= meet_obstacle(x, y, way[i], obstacles, o)[0] > 0.0
        for i in range(first):
            for j in range(i + 1, movers):
                dx = position[b, j, 0] - position[b, i, 0]
                dy = position[b, j, 1] - position[b, i, 1]
                reach = max(way[i] + way[j], 0.0)
                met |= dx * dx + dy * dy < reach * reach
        busy[b] = met


@njit(cache=True, nogil=True, error_model="numpy")
def coast(
    ground: Ground,
    law: Array,
    order: Order,
    motion: Motion,
    events: Events,
    busy: Array,
) -> None:
    """The others in closed form: paddles on their ramps, pucks in free flight."""
    paddles, pucks, _, _, _, mouths, _, control_dt, _ = ground
    position, velocity, goal = motion.position, motion.velocity, order.goal
    touching, leaning, out = events.touching, events.leaning, events.out
    for b in range(len(law)):
        if busy[b]:
            continue
        for i in range(paddles):
            for axis in range(2):
                start = velocity[b, i, axis]
                start = goal[b, i, axis] if order.told[b, i] else start
                mean = 0.5 * (start + goal[b, i, axis])
                position[b, i, axis] += mean * control_dt
                velocity[b, i, axis] = goal[b, i, axis]
        kick = 0.5 * law[b, FALL]
        for k in range(pucks):
            i = paddles + k
            for j in range(paddles):
                touching[b, j, k] = False
            for m in range(len(mouths)):
                leaning[b, k, m] = False
            if out[b, k]:
                velocity[b, i, 0] = velocity[b, i, 1] = 0.0
                continue
            vx, vy = velocity[b, i, 0] - kick, velocity[b, i, 1]
            position[b, i, 0] += law[b, COAST_WAY] * vx + law[b, COAST_DROP]
            position[b, i, 1] += law[b, COAST_WAY] * vy
            velocity[b, i, 0] = law[b, COAST_FADE] * vx + law[b, COAST_FALL] + kick
            velocity[b, i, 1] = law[b, COAST_FADE] * vy
