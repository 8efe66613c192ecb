"""Worlds in which nothing can meet within a control step, and their closed form."""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.backends.numba.arrays import (
    COAST_DROP,
    COAST_FADE,
    COAST_FALL,
    COAST_WAY,
    FALL,
    GRIP,
    Batch,
)
from marl_airhockey.backends.numba.contacts import meet_obstacle
from marl_airhockey.types import Array


@njit(cache=True, nogil=True, error_model="numpy")
def begin(batch: Batch) -> None:
    """Everything as it was at the end of the last step, and nothing has happened."""
    last, motion, events = batch.last, batch.motion, batch.events
    # Loops: for few worlds, numba's copies of whole arrays cost more than what they do.
    worlds, bodies, _ = motion.position.shape
    _, paddles, pucks = events.touched.shape
    goal_lines = events.crossed.shape[2]
    for b in range(worlds):
        motion.time[b] = last.time[b] + batch.ground.control_dt
        for i in range(bodies):
            for axis in range(2):
                motion.position[b, i, axis] = last.position[b, i, axis]
                motion.velocity[b, i, axis] = last.velocity[b, i, axis]
        for k in range(pucks):
            for i in range(paddles):
                events.touched[b, i, k], events.touched_at[b, i, k] = 0, np.nan
                events.touching[b, i, k] = last.touching[b, i, k]
            for m in range(goal_lines):
                events.crossed[b, k, m] = False
                events.crossed_velocity[b, k, m, 0] = 0.0
                events.crossed_velocity[b, k, m, 1] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def find_busy(batch: Batch, busy: Array) -> None:
    """In which worlds bodies may meet anything within the step.

    A ramp is a parabola, which lies between its control points; drag keeps a puck on
    the way of free flight. So a body comes no nearer to a thing than the best of these
    points, seen along the line to it at the beginning, and the way of its fall.
    """
    ground, law, order, _, motion, events = batch
    paddles, pucks, blocks, radius, lines, _, obstacles, control_dt, n = ground
    position, velocity, _, push, _ = motion
    goal, out = order.goal, events.out
    first, movers = paddles + pucks, paddles + pucks + blocks
    # Where the control points of each body lie, from its place.
    early, late = np.zeros((movers, 2)), np.zeros((movers, 2))
    for b in range(len(law)):
        met, drop = False, law[b, FALL] * n * control_dt
        for i in range(movers):
            vx, vy = velocity[b, i, 0], velocity[b, i, 1]
            if i < paddles:
                gx, gy = goal[b, i, 0], goal[b, i, 1]
                if order.prescribed[b, i]:
                    vx, vy = gx, gy
                early[i, 0], early[i, 1] = 0.5 * vx * control_dt, 0.5 * vy * control_dt
                late[i, 0] = 0.5 * (vx + gx) * control_dt
                late[i, 1] = 0.5 * (vy + gy) * control_dt
            elif i < first:
                early[i, 0], early[i, 1] = vx * control_dt, vy * control_dt
                late[i, 0], late[i, 1] = early[i, 0], early[i, 1]
            else:
                met |= vx != 0.0 or vy != 0.0 or law[b, FALL] > law[b, GRIP]
                met |= push[b, i, 0] != 0.0 or push[b, i, 1] != 0.0
        for i in range(paddles, first):
            # A puck out of play meets nothing.
            if out[b, i - paddles]:
                continue
            x, y, size = position[b, i, 0], position[b, i, 1], radius[i] + drop
            for s in range(len(lines)):
                nx, ny = lines[s, 0], lines[s, 1]
                nearing = max(-(nx * late[i, 0] + ny * late[i, 1]), 0.0)
                met |= nx * x + ny * y + lines[s, 2] < size + nearing
            if len(obstacles) > 0:
                way = np.sqrt(late[i, 0] ** 2 + late[i, 1] ** 2)
                for o in range(len(obstacles)):
                    met |= meet_obstacle(x, y, size + way, obstacles, o)[0] > 0.0
        for i in range(first):
            if i >= paddles and out[b, i - paddles]:
                continue
            for j in range(i + 1, movers):
                if paddles <= j < first and out[b, j - paddles]:
                    continue
                dx = position[b, j, 0] - position[b, i, 0]
                dy = position[b, j, 1] - position[b, i, 1]
                gap = dx * dx + dy * dy
                mine = max(dx * early[i, 0] + dy * early[i, 1], 0.0)
                mine = max(mine, dx * late[i, 0] + dy * late[i, 1])
                other = max(-(dx * early[j, 0] + dy * early[j, 1]), 0.0)
                other = max(other, -(dx * late[j, 0] + dy * late[j, 1]))
                reach, left = radius[i] + radius[j] + drop, gap - mine - other
                met |= left <= 0.0 or left * left < reach * reach * gap
        busy[b] = met


@njit(cache=True, nogil=True, error_model="numpy")
def coast(batch: Batch, busy: Array) -> None:
    """The others in closed form: paddles on their ramps, pucks in free flight."""
    ground, law, order, _, motion, events = batch
    paddles, pucks, _, _, _, goal_lines, _, control_dt, _ = ground
    position, velocity, goal = motion.position, motion.velocity, order.goal
    touching, leaning, out = events.touching, events.leaning, events.out
    for b in range(len(law)):
        if busy[b]:
            continue
        for i in range(paddles):
            for axis in range(2):
                start = velocity[b, i, axis]
                start = goal[b, i, axis] if order.prescribed[b, i] else start
                mean = 0.5 * (start + goal[b, i, axis])
                position[b, i, axis] += mean * control_dt
                velocity[b, i, axis] = goal[b, i, axis]
        kick = 0.5 * law[b, FALL]
        for k in range(pucks):
            i = paddles + k
            for j in range(paddles):
                touching[b, j, k] = False
            for m in range(len(goal_lines)):
                leaning[b, k, m] = False
            if out[b, k]:
                velocity[b, i, 0] = velocity[b, i, 1] = 0.0
                continue
            vx, vy = velocity[b, i, 0] - kick, velocity[b, i, 1]
            position[b, i, 0] += law[b, COAST_WAY] * vx + law[b, COAST_DROP]
            position[b, i, 1] += law[b, COAST_WAY] * vy
            velocity[b, i, 0] = law[b, COAST_FADE] * vx + law[b, COAST_FALL] + kick
            velocity[b, i, 1] = law[b, COAST_FADE] * vy
