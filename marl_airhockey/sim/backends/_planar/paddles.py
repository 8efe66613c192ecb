"""Paddles of 2D backends: tracking of commands, and contacts between paddles."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.backend import MAX_PRESCRIBED_SPEED
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.jit.elementary import hypot
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
    """Compute the velocities of paddles, and which are position-driven or raised.

    Args:
        velocity: Commanded velocities (B, paddles, 2), table frame, m/s.
        prescribed: Positions and velocities of position-driven paddles at the end of
            the step (B, paddles, 4), table frame, m and m/s; nan for all others.
        above: True for paddles that are commanded to be raised (B, paddles).
        position: Positions (B, N, 2), paddles first, table frame, m.
        dt: Length of the step, s.
        goal: Velocities at the end of the step (B, paddles, 2), m/s, filled. A
            position-driven paddle has its velocity during the whole step.
        imposed: True for position-driven paddles (B, paddles), filled.
        raised: True for paddles above the table, which touch nothing (B, paddles),
            filled. These are commanded to be raised, or position-driven and faster
            than `MAX_PRESCRIBED_SPEED`.
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
            speed = hypot(goal[b, i, 0], goal[b, i, 1])
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
    """Move paddles by a substep of their linear velocity ramps, in place.

    Args:
        position: Positions (paddles, 2), table frame, m, changed.
        velocity: Velocities (paddles, 2), table frame, m/s, changed.
        goal: Velocities after the ``left`` remaining substeps (paddles, 2), m/s.
        prescribed: True for position-driven paddles, which move at their goal velocity
            and do not yield (paddles,).
        raised: True for paddles that touch nothing (paddles,).
        left: Number of remaining substeps of the ramp.
        dt: Length of a substep, s.
        diameter: Distance of two centres in contact, m.
        mean: Mean velocities within the substep (paddles, 2), m/s, filled.

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

    Each paddle moves back by half of the overlap, and both get the mean of their normal
    velocities. A position-driven paddle does not yield. The other paddle moves back by
    the whole overlap and gets the normal velocity of the position-driven one.

    Args:
        position: Positions (paddles, 2), table frame, m, changed.
        velocity: Velocities (paddles, 2), table frame, m/s, changed.
        prescribed: True for position-driven paddles (paddles,).
        raised: True for paddles that touch nothing (paddles,).
        diameter: Distance of two centres in contact, m.
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
    """Move paddles back to the edges of their workspaces, where they stop.

    Args:
        position: Positions (paddles, 2), table frame, m, changed.
        velocity: Velocities (paddles, 2), table frame, m/s, changed.
        held: True for paddles that the workspace limits (paddles,).
        normals: Inward normals of the edges (paddles, K, 2), see `core.seat.reaches`.
        offsets: Offsets of the edges (paddles, K), m, see `core.seat.reaches`.

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
