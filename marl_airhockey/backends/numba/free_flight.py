"""Free flight: closed form of worlds without a contact in a control step."""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.backends.numba.arrays import (
    FALL,
    FLIGHT_DISTANCE,
    FLIGHT_DROP,
    FLIGHT_FADE,
    FLIGHT_FALL,
    FRICTION,
    Batch,
)
from marl_airhockey.backends.numba.contacts import contact_obstacle
from marl_airhockey.types import Array


@njit(cache=True, nogil=True, error_model="numpy")
def carry_over(batch: Batch) -> None:
    """Fill the result with the state before the step and no events."""
    previous, motion, events = batch.previous, batch.motion, batch.events
    # Loops: for few worlds, numba's copies of whole arrays are slower.
    worlds, bodies, _ = motion.position.shape
    _, paddles, pucks = events.touched.shape
    goal_lines, sides = events.crossed.shape[2], events.banked.shape[2]
    for b in range(worlds):
        motion.time[b] = previous.time[b] + batch.static.control_dt
        for i in range(bodies):
            for axis in range(2):
                motion.position[b, i, axis] = previous.position[b, i, axis]
                motion.velocity[b, i, axis] = previous.velocity[b, i, axis]
        for k in range(pucks):
            for i in range(paddles):
                events.touched[b, i, k], events.touched_at[b, i, k] = 0, np.nan
                events.touching[b, i, k] = previous.touching[b, i, k]
            for s in range(sides):
                events.banked[b, k, s] = 0
            for m in range(goal_lines):
                events.crossed[b, k, m] = False
                events.crossed_velocity[b, k, m, 0] = 0.0
                events.crossed_velocity[b, k, m, 1] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def find_collisions(batch: Batch, may_collide: Array) -> None:
    """Mark the worlds in which a body may touch anything within the step.

    A ramp is a parabola, which lies between its control points; drag keeps a puck on
    the path of free flight. So a body comes no nearer to an object than the nearest of
    these points, projected on the initial line to it, less the distance of its fall.
    """
    static, coefficients, commands, _, motion, events = batch
    paddles, pucks, blocks, radius, lines, _, obstacles, control_dt, n = static
    position, velocity, push = motion.position, motion.velocity, motion.push
    goal, out = commands.goal, events.out
    first, movers = paddles + pucks, paddles + pucks + blocks
    # Control points of each body relative to its position.
    early, late = np.zeros((movers, 2)), np.zeros((movers, 2))
    for b in range(len(coefficients)):
        near, drop = False, coefficients[b, FALL] * n * control_dt
        for i in range(movers):
            vx, vy = velocity[b, i, 0], velocity[b, i, 1]
            if i < paddles:
                gx, gy = goal[b, i, 0], goal[b, i, 1]
                if commands.prescribed[b, i]:
                    vx, vy = gx, gy
                early[i, 0], early[i, 1] = 0.5 * vx * control_dt, 0.5 * vy * control_dt
                late[i, 0] = 0.5 * (vx + gx) * control_dt
                late[i, 1] = 0.5 * (vy + gy) * control_dt
            elif i < first:
                early[i, 0], early[i, 1] = vx * control_dt, vy * control_dt
                late[i, 0], late[i, 1] = early[i, 0], early[i, 1]
            else:
                near |= (
                    vx != 0.0
                    or vy != 0.0
                    or coefficients[b, FALL] > coefficients[b, FRICTION]
                )
                near |= push[b, i, 0] != 0.0 or push[b, i, 1] != 0.0
        for i in range(paddles, first):
            # A puck out of play touches nothing.
            if out[b, i - paddles]:
                continue
            x, y, size = position[b, i, 0], position[b, i, 1], radius[i] + drop
            for s in range(len(lines)):
                nx, ny = lines[s, 0], lines[s, 1]
                nearing = max(-(nx * late[i, 0] + ny * late[i, 1]), 0.0)
                near |= nx * x + ny * y + lines[s, 2] < size + nearing
            if len(obstacles) > 0:
                distance = np.sqrt(late[i, 0] ** 2 + late[i, 1] ** 2)
                for o in range(len(obstacles)):
                    near |= (
                        contact_obstacle(x, y, size + distance, obstacles, o)[0] > 0.0
                    )
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
                near |= left <= 0.0 or left * left < reach * reach * gap
        may_collide[b] = near


@njit(cache=True, nogil=True, error_model="numpy")
def fly_freely(batch: Batch, may_collide: Array) -> None:
    """Move the other worlds in closed form: paddles on ramps, pucks in free flight."""
    static, coefficients, commands, _, motion, events = batch
    paddles, pucks, _, _, lines, _, _, control_dt, _ = static
    position, velocity, goal = motion.position, motion.velocity, commands.goal
    touching, against, out = events.touching, events.against, events.out
    for b in range(len(coefficients)):
        if may_collide[b]:
            continue
        for i in range(paddles):
            for axis in range(2):
                start = velocity[b, i, axis]
                start = goal[b, i, axis] if commands.prescribed[b, i] else start
                mean = 0.5 * (start + goal[b, i, axis])
                position[b, i, axis] += mean * control_dt
                velocity[b, i, axis] = goal[b, i, axis]
        row = coefficients[b]
        leapfrog_offset = 0.5 * row[FALL]
        for k in range(pucks):
            i = paddles + k
            for j in range(paddles):
                touching[b, j, k] = False
            for s in range(len(lines)):
                against[b, k, s] = False
            if out[b, k]:
                velocity[b, i, 0] = velocity[b, i, 1] = 0.0
                continue
            vx, vy = velocity[b, i, 0] - leapfrog_offset, velocity[b, i, 1]
            position[b, i, 0] += (
                coefficients[b, FLIGHT_DISTANCE] * vx + coefficients[b, FLIGHT_DROP]
            )
            position[b, i, 1] += coefficients[b, FLIGHT_DISTANCE] * vy
            velocity[b, i, 0] = (
                coefficients[b, FLIGHT_FADE] * vx
                + coefficients[b, FLIGHT_FALL]
                + leapfrog_offset
            )
            velocity[b, i, 1] = coefficients[b, FLIGHT_FADE] * vy
