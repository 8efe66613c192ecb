"""Overlaps: separation of bodies, and return of paddles into their workspaces."""

from __future__ import annotations

from marl_airhockey.sim.backends.numba.bodies import (
    AWAY,
    HELD,
    INSIDE,
    RADIUS,
    X,
    Y,
    distance_between,
    fixed_range,
    partner,
    shares,
    slop,
)
from marl_airhockey.sim.backends.numba.geometry import distance_to_fixed
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array


@inner(error_model="numpy")
def take_apart(
    m: Array, role: Array, walls: Array, obstacles: Array, held: int, edges: int
) -> None:
    """Separate overlapping bodies: pucks yield first, then paddles that may yield.

    Args:
        m: Bodies (N, BODY), moved.
        role: Roles of the bodies (N,); a paddle with the role `ASKS` may yield.
        walls: Walls, see `arrays.make_walls`.
        obstacles: Obstacles (O, 5), see `arrays.Static`.
        held: Number of edges of all workspaces, which are the first walls.
        edges: Number of edges of one workspace.
    """
    fixed = len(walls) + len(obstacles)
    for sweep in range(100):
        deepest = 0.0
        for j in range(len(m)):
            # Fixed objects are last, so that no body remains in one.
            low, high = fixed_range(m, role, j, held, edges, fixed)
            for place in range(j + high - low):
                i = partner(place, j, low)
                if role[j] >= AWAY or (i >= 0 and role[i] >= AWAY):
                    continue
                gap, nx, ny = distance_between(m, i, j, walls, obstacles)
                deep = -gap - slop(role, i, j)
                if deep <= 0.0:
                    continue
                wi, wj, _, _ = shares(m, role, i, j, sweep >= 12)
                if wi + wj == 0.0:
                    continue
                deepest = max(deepest, deep)
                mine, other = wi / (wi + wj), wj / (wi + wj)
                m[j, X] += nx * deep * other
                m[j, Y] += ny * deep * other
                m[j, HELD] = m[j, INSIDE]
                if i >= 0:
                    m[i, X] -= nx * deep * mine
                    m[i, Y] -= ny * deep * mine
                    m[i, HELD] = m[i, INSIDE]
        if deepest < 1e-6:
            return


@inner(error_model="numpy")
def keep_in_reach(m: Array, walls: Array, paddles: int, edges: int) -> None:
    """Move paddles with `HELD` back into their workspaces."""
    for j in range(paddles):
        for _ in range(100 if m[j, HELD] > 0.0 else 0):
            outside = 0.0
            for f in range(j * edges, (j + 1) * edges):
                gap, nx, ny = distance_to_fixed(m[j, X], m[j, Y], f, walls, walls)
                deep = m[j, RADIUS] - gap
                if deep > 0.0:
                    outside = max(outside, deep)
                    m[j, X] += deep * nx
                    m[j, Y] += deep * ny
            if outside < 1e-12:
                break
