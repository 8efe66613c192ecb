"""Flight: motion of the worlds in which no contact can occur within a step.

Worlds are processed in blocks. In a block, the values of all worlds are adjacent in
memory, so that loops over the worlds compile to vector instructions.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.arrays import (
    BLOCK_GRIP,
    DAMPING,
    DRAG,
    PULL,
    PULL_X,
    PULL_Y,
    STEP_TIME,
    Batch,
)
from marl_airhockey.sim.backends.numba.geometry import (
    OUTSIDE,
    RELEASE,
    distance_to_fixed,
    stays_in_reach,
)
from marl_airhockey.sim.core.laws import cap, fly_slowed
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.sim.jit.pipeline import view
from marl_airhockey.types import Array

WORLDS = 64
"""Number of worlds in a block."""
X, Y, VX, VY, EARLY_X, EARLY_Y, LATE_X, LATE_Y, FREE = range(9)
ROWS = 9
"""Rows of a body: position (m); velocity at the end of the step (m/s); two
displacements that bound its path (m); 1 for a paddle that follows commands and for a
puck in play, else 0."""
DROP, ROOM, AHEAD = range(3)
"""Rows after the rows of all bodies: fall of a body within the step (m); clearance of
all bodies, below 0 if a contact may occur; smallest distance between the path of a
paddle and the edges of its workspace (m)."""


@inner(error_model="numpy")
def block_space(movers: int) -> Array:
    """Return the work space of `fly_freely`, which its caller owns."""
    return np.empty((movers + 1) * ROWS * WORLDS)


@inner(error_model="numpy")
def fly_freely(batch: Batch, active: Array, work: Array) -> bool:
    """Move the worlds in which no contact can occur, and mark all others as active.

    The events of all worlds are cleared, and their clocks advance. The bodies of an
    active world end at positions that ignore contacts.

    Args:
        batch: Arrays of the kernel.
        active: True for active worlds (B,), filled.
        work: Work space, see `block_space`.

    Returns:
        True if any world is active.
    """
    _clear_events(batch)
    if batch.result.path.shape[1] > 0:
        active[:] = True
        return True
    paddles, pucks, blocks = batch.static[:3]
    movers, some = paddles + pucks + blocks, False
    # With constant lengths the compiler can see that rows do not overlap.
    m = view(work.ctypes.data, (movers + 1, ROWS, WORLDS), np.float64)
    for start in range(0, len(active), WORLDS):
        count = min(WORLDS, len(active) - start)
        _gather(batch, start, count, m)
        _find_room_at_sides(batch, count, m)
        _find_room_in_reach(batch, count, m)
        _find_room_between(batch, count, m)
        for c in range(count):
            active[start + c] = not m[movers, ROOM, c] >= 0.0
            some |= active[start + c]
        _move(batch, start, count, m, active)
    return some


@inner(error_model="numpy")
def _clear_events(batch: Batch) -> None:
    """Advance the clocks and clear the events of the last step."""
    result, dt = batch.result, batch.static.control_dt
    for b in range(len(result.time)):
        result.time[b] = batch.previous.time[b] + dt
    _fill(result.touched, 0)
    _fill(result.touched_at, np.nan)
    _fill(result.touching, False)
    _fill(result.banked, 0)
    _fill(result.crossed, False)
    _fill(result.crossed_velocity, 0.0)
    _fill(result.lifted, False)


@inner(error_model="numpy", forceinline=True)
def _fill(array: Array, value: float) -> None:
    # One flat loop: nested loops and, for few worlds, numba's own fill are slower.
    flat = array.reshape(-1)
    for i in range(len(flat)):
        flat[i] = value


@inner(error_model="numpy", forceinline=True)
def _gather(batch: Batch, start: int, count: int, m: Array) -> None:
    """Fill the rows of a block of worlds."""
    static, coefficients, commands, previous, result = batch[:5]
    paddles, pucks, blocks, dt = *static[:3], static.control_dt
    first, last, half = paddles + pucks, paddles + pucks + blocks, 0.5 * dt
    position, velocity, goal = previous.position, previous.velocity, commands.goal
    for i in range(last):
        for c in range(count):
            b = start + c
            vx, vy = velocity[b, i, 0], velocity[b, i, 1]
            m[i, X, c], m[i, Y, c] = position[b, i, 0], position[b, i, 1]
            m[i, VX, c], m[i, VY, c] = vx, vy
            m[i, EARLY_X, c] = m[i, LATE_X, c] = vx * dt
            m[i, EARLY_Y, c] = m[i, LATE_Y, c] = vy * dt
    for i in range(paddles):
        for c in range(count):
            gx, gy = goal[start + c, i, 0], goal[start + c, i, 1]
            prescribed = commands.prescribed[start + c, i]
            vx = gx if prescribed else m[i, VX, c]
            vy = gy if prescribed else m[i, VY, c]
            m[i, EARLY_X, c], m[i, EARLY_Y, c] = half * vx, half * vy
            m[i, LATE_X, c], m[i, LATE_Y, c] = half * (vx + gx), half * (vy + gy)
            m[i, VX, c], m[i, VY, c] = gx, gy
            m[i, FREE, c] = 0.0 if prescribed else 1.0
    for k in range(pucks):
        for c in range(count):
            m[paddles + k, FREE, c] = 0.0 if result.out[start + c, k] else 1.0
    for c in range(count):
        pull = coefficients[start + c, PULL]
        m[last, DROP, c], m[last, ROOM, c] = 0.5 * pull * dt * dt + RELEASE, np.inf
    for i in range(first, last):
        for c in range(count):
            row = coefficients[start + c]
            moves = m[i, VX, c] != 0.0 or m[i, VY, c] != 0.0
            if moves or row[PULL] > row[BLOCK_GRIP]:
                m[last, ROOM, c] = -1.0


@inner(error_model="numpy", forceinline=True)
def _find_room_at_sides(batch: Batch, count: int, m: Array) -> None:
    """Find the clearance between pucks and fixed objects; see `list_pairs`."""
    static = batch.static
    paddles, pucks, blocks, radius, walls = static[:5]
    obstacles, fixed = static.obstacles, len(walls) + len(static.obstacles)
    first, last = paddles + pucks, paddles + pucks + blocks
    for i in range(paddles, first):
        for f in range(paddles * static.edges, len(walls)):
            nx, ny, offset = walls[f, 0], walls[f, 1], walls[f, 2] - radius[i]
            for c in range(count):
                ahead = nx * m[i, X, c] + ny * m[i, Y, c] + offset - m[last, DROP, c]
                ahead += min(nx * m[i, LATE_X, c] + ny * m[i, LATE_Y, c], 0.0)
                m[last, ROOM, c] = min(m[last, ROOM, c], ahead)
        for f in range(len(walls), fixed):
            for c in range(count):
                x, y = m[i, X, c], m[i, Y, c]
                gap, _, _ = distance_to_fixed(x, y, f, walls, obstacles)
                way = np.sqrt(m[i, LATE_X, c] ** 2 + m[i, LATE_Y, c] ** 2)
                ahead = gap - way - radius[i] - m[last, DROP, c]
                m[last, ROOM, c] = min(m[last, ROOM, c], ahead)


@inner(error_model="numpy", forceinline=True)
def _find_room_in_reach(batch: Batch, count: int, m: Array) -> None:
    """Find the paddles that leave their workspaces; see `stays_in_reach`."""
    paddles, pucks, blocks, radius, walls = batch.static[:5]
    edges, last = batch.static.edges, paddles + pucks + blocks
    for i in range(paddles):
        low, high = i * edges, (i + 1) * edges
        for c in range(count):
            m[last, AHEAD, c] = np.inf
        for f in range(low, high):
            nx, ny, offset = walls[f, 0], walls[f, 1], walls[f, 2] - radius[i]
            for c in range(count):
                here = nx * m[i, X, c] + ny * m[i, Y, c] + offset
                early = nx * m[i, EARLY_X, c] + ny * m[i, EARLY_Y, c]
                late = nx * m[i, LATE_X, c] + ny * m[i, LATE_Y, c]
                m[last, AHEAD, c] = min(m[last, AHEAD, c], here + min(early, late))
        for c in range(count):
            if m[last, AHEAD, c] <= -OUTSIDE and m[i, FREE, c] > 0.0:
                place, way = (m[i, X, c], m[i, Y, c]), (0.0, 0.0, 0.0, 0.0)
                inside, _ = stays_in_reach(*place, way, walls, low, high, radius[i])
                if inside:
                    m[last, ROOM, c] = -1.0


@inner(error_model="numpy", forceinline=True)
def _find_room_between(batch: Batch, count: int, m: Array) -> None:
    """Find the clearance between bodies; see `list_pairs`."""
    paddles, pucks, blocks, radius = batch.static[:4]
    last = paddles + pucks + blocks
    for i in range(paddles + pucks):
        for j in range(i + 1, last):
            touch = radius[i] + radius[j]
            for c in range(count):
                dx, dy = m[j, X, c] - m[i, X, c], m[j, Y, c] - m[i, Y, c]
                early = dx * m[i, EARLY_X, c] + dy * m[i, EARLY_Y, c]
                mine = max(early, dx * m[i, LATE_X, c] + dy * m[i, LATE_Y, c])
                early = dx * m[j, EARLY_X, c] + dy * m[j, EARLY_Y, c]
                other = min(early, dx * m[j, LATE_X, c] + dy * m[j, LATE_Y, c])
                # The relative fall of two bodies is at most the fall of one.
                square, least = dx * dx + dy * dy, touch + m[last, DROP, c]
                left = square - max(mine, 0.0) + min(other, 0.0)
                room = left * left - least * least * square if left > 0.0 else -1.0
                m[last, ROOM, c] = min(m[last, ROOM, c], room)


@inner(error_model="numpy", forceinline=True)
def _move(batch: Batch, start: int, count: int, m: Array, active: Array) -> None:
    """Move bodies: paddles along velocity ramps, pucks in free flight."""
    static, coefficients, _, previous, result = batch[:5]
    paddles, pucks, blocks, dt = *static[:3], static.control_dt
    first, last = paddles + pucks, paddles + pucks + blocks
    for i in range(paddles):
        for c in range(count):
            m[i, X, c] += m[i, LATE_X, c]
            m[i, Y, c] += m[i, LATE_Y, c]
    for i in range(paddles, first):
        for c in range(count):
            b, free = start + c, m[i, FREE, c] > 0.0
            row, vx, vy = coefficients[b], m[i, VX, c], m[i, VY, c]
            share = cap(vx, vy)
            x, y, vx, vy = fly_slowed(
                *(share * vx, share * vy, dt, row[STEP_TIME]),
                *(row[PULL_X], row[PULL_Y], row[DAMPING], row[DRAG]),
            )
            share = cap(vx, vy)
            m[i, X, c] += x if free else 0.0
            m[i, Y, c] += y if free else 0.0
            m[i, VX, c] = share * vx if free else 0.0
            m[i, VY, c] = share * vy if free else 0.0
            spin = previous.spin[b, i] if free else 0.0
            result.spin[b, i] = spin
            result.angle[b, i] = previous.angle[b, i] + spin * dt
    for i in range(last):
        for c in range(count):
            b = start + c
            result.position[b, i, 0], result.position[b, i, 1] = m[i, X, c], m[i, Y, c]
            result.velocity[b, i, 0] = m[i, VX, c]
            result.velocity[b, i, 1] = m[i, VY, c]
    for i in range(last, result.position.shape[1]):
        for b in range(start, start + count):
            for axis in range(2):
                result.position[b, i, axis] = previous.position[b, i, axis]
                result.velocity[b, i, axis] = previous.velocity[b, i, axis]
    for k in range(pucks):
        for b in range(start, start + count):
            result.pinned[b, k] = result.pinned[b, k] if active[b] else 0.0
        for s in range(result.against.shape[2]):
            for b in range(start, start + count):
                result.against[b, k, s] &= active[b]
