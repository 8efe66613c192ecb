"""Broad phase: lists of the pairs that can come into contact within a time."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.arrays import PULL
from marl_airhockey.sim.backends.numba.bodies import (
    AWAY,
    BEND,
    DX,
    EARLY_X,
    EARLY_Y,
    FALL,
    GX,
    GY,
    LATE_X,
    LATE_Y,
    MASS,
    PRESCRIBED,
    REACH,
    VX,
    VY,
    closing,
    distance_between,
    fixed_range,
    partner,
)
from marl_airhockey.sim.backends.numba.geometry import RELEASE
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

BOW = 3e-4
"""Largest distance between a curved path and its chord in a move, m."""


@inner(error_model="numpy", forceinline=True)
def list_pairs(
    m: Array,
    role: Array,
    row: Array,
    walls: Array,
    obstacles: Array,
    held: int,
    edges: int,
    left: float,
    near: Array,
) -> int:
    """List the pairs that can come into contact in the rest of the step.

    The path of a velocity ramp is a parabola, which lies between its control points.
    With drag of any form, the displacement of a puck is v F + g H, where
    0 <= F <= T and 0 <= H <= T2 / 2. The smallest distance from a body to an object
    follows from the nearest of these points, projected on the initial line to the
    object. The distance of the fall is subtracted.

    Args:
        m: Bodies (N, BODY); `REACH`, `BEND`, `FALL` and the displacements are filled.
        role: Roles of the bodies (N,).
        row: Coefficients of the world (COEFFICIENTS,).
        walls: Walls, see `arrays.make_walls`.
        obstacles: Obstacles (O, 5), see `arrays.Static`.
        held: Number of edges of all workspaces, which are the first walls.
        edges: Number of edges of one workspace.
        left: Rest of the step, s.
        near: Bodies of each pair (size, 2), filled; the fixed object f is -1 - f.

    Returns:
        Number of pairs.
    """
    pull = row[PULL]
    for i in range(len(m)):
        vx, vy, half = m[i, VX], m[i, VY], 0.5 * left
        speed = vx * vx + vy * vy
        if m[i, MASS] == 0.0:
            gx, gy = m[i, GX], m[i, GY]
            m[i, EARLY_X], m[i, EARLY_Y] = half * vx, half * vy
            m[i, LATE_X], m[i, LATE_Y] = half * (vx + gx), half * (vy + gy)
            bend = (gx - vx) ** 2 + (gy - vy) ** 2
            m[i, BEND] = np.sqrt(bend) / max(left, 1e-12)
            m[i, REACH] = np.sqrt(max(speed, gx * gx + gy * gy))
            m[i, FALL] = 0.0
        else:
            m[i, EARLY_X] = m[i, LATE_X] = left * vx
            m[i, EARLY_Y] = m[i, LATE_Y] = left * vy
            m[i, BEND] = pull
            m[i, REACH] = np.sqrt(speed) + pull * left
            m[i, FALL] = pull * half * left
    count, fixed = 0, len(walls) + len(obstacles)
    for j in range(len(m)):
        low, high = fixed_range(m, role, j, held, edges, fixed)
        for place in range(j + high - low if role[j] < AWAY else 0):
            i = partner(place, j, low)
            if i >= 0 and role[i] >= AWAY:
                continue
            if i >= 0 and role[i] == PRESCRIBED and role[j] == PRESCRIBED:
                continue
            gap, nx, ny = distance_between(m, i, j, walls, obstacles)
            early = nx * m[j, EARLY_X] + ny * m[j, EARLY_Y]
            gap += min(early, nx * m[j, LATE_X] + ny * m[j, LATE_Y], 0.0) - m[j, FALL]
            if i >= 0:
                early = nx * m[i, EARLY_X] + ny * m[i, EARLY_Y]
                late = nx * m[i, LATE_X] + ny * m[i, LATE_Y]
                gap -= max(early, late, 0.0) + m[i, FALL]
            if gap < RELEASE:
                near[count, 0], near[count, 1] = i, j
                count += 1
    return count


@inner(error_model="numpy")
def list_near_drift(
    m: Array,
    role: Array,
    walls: Array,
    obstacles: Array,
    held: int,
    edges: int,
    h: float,
    near: Array,
) -> int:
    """List the pairs that can come into contact in h s at the mean velocities."""
    count, fixed = 0, len(walls) + len(obstacles)
    for j in range(len(m)):
        low, high = fixed_range(m, role, j, held, edges, fixed)
        for place in range(j + high - low if role[j] < AWAY else 0):
            i = partner(place, j, low)
            if i < 0 or role[i] < AWAY:
                gap, nx, ny = distance_between(m, i, j, walls, obstacles)
                if gap + closing(m, DX, i, j, nx, ny) * h < RELEASE:
                    near[count, 0], near[count, 1] = i, j
                    count += 1
    return count


@inner(error_model="numpy", forceinline=True)
def longest_move(m: Array, role: Array, near: Array, count: int) -> float:
    """Return the longest move, s, in which paths differ from chords by up to `BOW`."""
    bend = 0.0
    for k in range(count):
        i, j = near[k, 0], near[k, 1]
        # A ramp that ends in a workspace stays in it, and so do its chords.
        if i >= 0:
            bend = max(bend, m[i, BEND] + m[j, BEND])
        elif role[j] > PRESCRIBED:
            bend = max(bend, m[j, BEND])
    return float(np.sqrt(8.0 * BOW / bend)) if bend > 0.0 else np.inf
