"""Paddles of 2D backends: tracking of commands, and contacts between paddles."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.backend import MAX_PRESCRIBED_SPEED
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array


@compiled(nogil=True, error_model="numpy")
def follow(
    velocity: Array,
    prescribed: Array,
    above: Array,
    position: Array,
    dt: float,
    goal: Array,
    imposed: Array,
    raised: Array,
) -> None:
    """Compute the velocities of paddles, and which are prescribed or raised.

    Args:
        velocity: (B, paddles, 2) commanded, m/s.
        prescribed: (B, paddles, 4) position and velocity at the end of the step, nan
            for paddles that follow their command.
        above: (B, paddles) bool: commanded to be raised.
        position: (B, N, 2) m, paddles first.
        dt: length of the step, s.
        goal: (B, paddles, 2) m/s at the end of the step, filled; that of a prescribed
            paddle holds during the whole step.
        imposed: (B, paddles) bool, filled: True if prescribed.
        raised: (B, paddles) bool, filled: True above the table, where it touches
            nothing: as commanded, or prescribed faster than `MAX_PRESCRIBED_SPEED`.
    """
    for b in range(len(goal)):
        for i in range(goal.shape[1]):
            goal[b, i, 0], goal[b, i, 1] = velocity[b, i, 0], velocity[b, i, 1]
            imposed[b, i], raised[b, i] = False, above[b, i]
            if np.isnan(prescribed[b, i, 0]):
                continue
            imposed[b, i] = True
            for axis in range(2):
                distance = prescribed[b, i, axis] - position[b, i, axis]
                goal[b, i, axis] = distance / dt
            speed = np.hypot(goal[b, i, 0], goal[b, i, 1])
            raised[b, i] |= speed > MAX_PRESCRIBED_SPEED


@compiled()
def ramp_paddles(
    position: Array,
    velocity: Array,
    goal: Array,
    prescribed: Array,
    raised: Array,
    left: int,
    dt: float,
    diameter: float,
    mean: Array,
) -> bool:
    """Move paddles by a substep of their linear ramps, in place.

    Args:
        position: (paddles, 2) m.
        velocity: (paddles, 2) m/s.
        goal: (paddles, 2) m/s after the ``left`` remaining substeps.
        prescribed: (paddles,) bool: moves at its goal velocity and does not yield.
        raised: (paddles,) bool: touches nothing.
        left: number of remaining substeps of the ramp.
        dt: length of a substep, s.
        diameter: distance of two centres in contact, m.
        mean: (paddles, 2) m/s, filled with the mean velocity within the substep.

    Returns:
        True if any pair overlapped.
    """
    for i in range(len(position)):
        for axis in range(2):
            if prescribed[i]:
                velocity[i, axis] = goal[i, axis]
            ramp = (goal[i, axis] - velocity[i, axis]) / left
            mean[i, axis] = velocity[i, axis] + 0.5 * ramp
            position[i, axis] += mean[i, axis] * dt
            velocity[i, axis] += ramp
    overlap = separate_paddles(position, velocity, prescribed, raised, diameter)
    if overlap:
        for i in range(len(mean)):
            mean[i, 0], mean[i, 1] = velocity[i, 0], velocity[i, 1]
    return overlap


@inner()
def separate_paddles(
    position: Array, velocity: Array, prescribed: Array, raised: Array, diameter: float
) -> bool:
    """Separate overlapping paddles in place; return True if any pair overlapped.

    Each is moved back by half of the overlap and both take the mean of their normal
    velocities. A prescribed paddle does not yield: the other is moved back by all of
    it and takes the prescribed one's normal velocity.

    Args:
        position: (paddles, 2) m, changed in place.
        velocity: (paddles, 2) m/s, changed in place.
        prescribed: (paddles,) bool.
        raised: (paddles,) bool: touches nothing.
        diameter: distance of two centres in contact, m.
    """
    overlap = False
    for i in range(len(prescribed) - 1):
        for j in range(i + 1, len(prescribed)):
            nx = position[j, 0] - position[i, 0]
            ny = position[j, 1] - position[i, 1]
            distance = np.sqrt(nx * nx + ny * ny)
            if distance >= diameter or (prescribed[i] and prescribed[j]):
                continue
            if raised[i] or raised[j]:
                continue
            overlap = True
            if distance > 1e-9:
                nx, ny = nx / distance, ny / distance
            else:
                nx, ny = 1.0, 0.0
            share = 0.5
            if prescribed[i] != prescribed[j]:
                share = 1.0 if prescribed[j] else 0.0
            back, forth = share * (diameter - distance), 1.0 - share
            forth *= diameter - distance
            position[i, 0] -= back * nx
            position[i, 1] -= back * ny
            position[j, 0] += forth * nx
            position[j, 1] += forth * ny
            vi = velocity[i, 0] * nx + velocity[i, 1] * ny
            vj = velocity[j, 0] * nx + velocity[j, 1] * ny
            if vi > vj:
                common = (1.0 - share) * vi + share * vj
                velocity[i, 0] += (common - vi) * nx
                velocity[i, 1] += (common - vi) * ny
                velocity[j, 0] += (common - vj) * nx
                velocity[j, 1] += (common - vj) * ny
    return overlap


@compiled()
def keep_in_reach(
    position: Array, velocity: Array, held: Array, normals: Array, offsets: Array
) -> bool:
    """Move paddles back to the edges of their reaches, where they stop.

    Args:
        position: (paddles, 2) m, changed in place.
        velocity: (paddles, 2) m/s, changed in place.
        held: (paddles,) bool: the reach counts.
        normals: `core.seat.reaches` (paddles, K, 2), like the next.
        offsets: (paddles, K) m.

    Returns:
        True if any paddle was outside.
    """
    moved = False
    for i in range(len(held)):
        for _ in range(100 if held[i] else 0):
            outside = 0.0
            for f in range(offsets.shape[1]):
                nx, ny = normals[i, f, 0], normals[i, f, 1]
                deep = -nx * position[i, 0] - ny * position[i, 1] - offsets[i, f]
                if deep <= 1e-12:
                    continue
                outside = max(outside, deep)
                position[i, 0] += deep * nx
                position[i, 1] += deep * ny
                out = min(nx * velocity[i, 0] + ny * velocity[i, 1], 0.0)
                velocity[i, 0] -= out * nx
                velocity[i, 1] -= out * ny
            if outside == 0.0:
                break
            moved = True
    return moved
