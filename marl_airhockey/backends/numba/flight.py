"""Flight: the worlds in which nothing can meet within a step, and their motion."""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.backends.numba.arrays import (
    BLOCK_GRIP,
    DAMPING,
    DRAG,
    PULL,
    PULL_X,
    PULL_Y,
    STEP_TIME,
    Batch,
)
from marl_airhockey.backends.numba.geometry import (
    RELEASE,
    distance_to_fixed,
    stays_in_reach,
)
from marl_airhockey.core.laws import cap, fly_slowed
from marl_airhockey.types import Array


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def clear_events(batch: Batch, b: int) -> None:
    """Advance the clock of world b and clear the events of its step."""
    result = batch.result
    _, paddles, pucks = result.touched.shape
    goal_lines, sides = result.crossed.shape[2], result.banked.shape[2]
    result.time[b] = batch.previous.time[b] + batch.static.control_dt
    # Loops: for few worlds, numba's copies of whole arrays are slower.
    for k in range(pucks):
        result.lifted[b, k] = False
        for i in range(paddles):
            result.touched[b, i, k], result.touched_at[b, i, k] = 0, np.nan
        for s in range(sides):
            result.banked[b, k, s] = 0
        for m in range(goal_lines):
            result.crossed[b, k, m] = False
            result.crossed_velocity[b, k, m, 0] = 0.0
            result.crossed_velocity[b, k, m, 1] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def fly_freely(batch: Batch, busy: Array) -> bool:
    """Move the worlds in which nothing can meet, and mark the others as busy."""
    some = False
    for b in range(len(busy)):
        busy[b] = batch.result.path.shape[1] > 0 or _may_touch(batch, b)
        if busy[b]:
            some = True
        else:
            _move(batch, b)
    return some


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _control_points(batch: Batch, b: int, i: int) -> tuple[float, float, float, float]:
    """Return two points that a body's way lies between, from where it is, m."""
    velocity, dt = batch.previous.velocity, batch.static.control_dt
    vx, vy = velocity[b, i, 0], velocity[b, i, 1]
    if i >= batch.static.paddles:
        return vx * dt, vy * dt, vx * dt, vy * dt
    gx, gy = batch.commands.goal[b, i, 0], batch.commands.goal[b, i, 1]
    if batch.commands.prescribed[b, i]:
        vx, vy = gx, gy
    half = 0.5 * dt
    return half * vx, half * vy, half * (vx + gx), half * (vy + gy)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _may_touch(batch: Batch, b: int) -> bool:
    """Return True if a body may touch anything within the step; see `list_near`."""
    static, coefficients, _, previous, result = batch
    paddles, pucks, blocks, radius, walls = static[:5]
    obstacles, dt = static.obstacles, static.control_dt
    position, velocity = previous.position, previous.velocity
    first, movers = paddles + pucks, paddles + pucks + blocks
    pull, near = coefficients[b, PULL], False
    drop = 0.5 * pull * dt * dt + RELEASE
    for i in range(first, movers):
        near |= velocity[b, i, 0] != 0.0 or velocity[b, i, 1] != 0.0
        near |= pull > coefficients[b, BLOCK_GRIP]
    for i in range(paddles, first):
        # A puck out of play touches nothing.
        if result.out[b, i - paddles]:
            continue
        x, y = position[b, i, 0], position[b, i, 1]
        wx, wy = velocity[b, i, 0] * dt, velocity[b, i, 1] * dt
        for f in range(paddles * static.edges, len(walls)):
            nx, ny = walls[f, 0], walls[f, 1]
            ahead = nx * x + ny * y + walls[f, 2]
            near |= ahead + min(nx * wx + ny * wy, 0.0) < radius[i] + drop
        for o in range(len(obstacles)):
            f, way = len(walls) + o, np.sqrt(wx * wx + wy * wy)
            gap, _, _ = distance_to_fixed(x, y, f, walls, obstacles)
            near |= gap < radius[i] + drop + way
    for i in range(first):
        if i >= paddles and result.out[b, i - paddles]:
            continue
        ex, ey, lx, ly = _control_points(batch, b, i)
        if i < paddles and not batch.commands.prescribed[b, i]:
            x, y, low = position[b, i, 0], position[b, i, 1], i * static.edges
            edges = low, low + static.edges
            way = ex, ey, lx, ly
            inside, stays = stays_in_reach(x, y, way, walls, *edges, radius[i])
            near |= inside and not stays
        for j in range(i + 1, movers):
            if paddles <= j < first and result.out[b, j - paddles]:
                continue
            fx, fy, mx, my = _control_points(batch, b, j)
            dx = position[b, j, 0] - position[b, i, 0]
            dy = position[b, j, 1] - position[b, i, 1]
            gap = dx * dx + dy * dy
            mine = max(dx * ex + dy * ey, dx * lx + dy * ly, 0.0)
            other = min(dx * fx + dy * fy, dx * mx + dy * my, 0.0)
            # Two bodies fall less apart than one falls.
            reach, left = radius[i] + radius[j] + drop, gap - mine + other
            near |= left <= 0.0 or left * left < reach * reach * gap
    return near


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _move(batch: Batch, b: int) -> None:
    """Move a world: paddles on ramps, pucks in free flight."""
    static, coefficients, commands, previous, result = batch
    paddles, pucks, dt = static.paddles, static.pucks, static.control_dt
    position, velocity, goal = previous.position, previous.velocity, commands.goal
    sides, bodies = result.against.shape[2], position.shape[1]
    clear_events(batch, b)
    for i in range(paddles):
        for axis in range(2):
            start, end = velocity[b, i, axis], goal[b, i, axis]
            start = end if commands.prescribed[b, i] else start
            way = 0.5 * (start + end) * dt
            result.position[b, i, axis] = position[b, i, axis] + way
            result.velocity[b, i, axis] = end
    gx, gy = coefficients[b, PULL_X], coefficients[b, PULL_Y]
    damping, drag = coefficients[b, DAMPING], coefficients[b, DRAG]
    time = coefficients[b, STEP_TIME]
    for k in range(pucks):
        i = paddles + k
        result.pinned[b, k] = 0.0
        for j in range(paddles):
            result.touching[b, j, k] = False
        for s in range(sides):
            result.against[b, k, s] = False
        x, y, vx, vy, spin = 0.0, 0.0, 0.0, 0.0, 0.0
        if not result.out[b, k]:
            vx, vy, spin = velocity[b, i, 0], velocity[b, i, 1], previous.spin[b, i]
            share = cap(vx, vy)
            x, y, vx, vy = fly_slowed(
                share * vx, share * vy, dt, time, gx, gy, damping, drag
            )
            share = cap(vx, vy)
            vx, vy = share * vx, share * vy
        result.position[b, i, 0] = position[b, i, 0] + x
        result.position[b, i, 1] = position[b, i, 1] + y
        result.velocity[b, i, 0], result.velocity[b, i, 1] = vx, vy
        result.angle[b, i] = previous.angle[b, i] + spin * dt
        result.spin[b, i] = spin
    for i in range(paddles + pucks, bodies):
        for axis in range(2):
            result.position[b, i, axis] = position[b, i, axis]
            result.velocity[b, i, axis] = velocity[b, i, axis]
