"""Impacts: one impulse law, and the solver for all contacts of a moment.

Contacts are solved as impacts of two bodies, one after the other and the hardest first.
Each conserves momentum and takes energy, so all of them do. Where that does not end,
or makes a puck faster than any blow could, a paddle that asks for a velocity stops.
The hardest-first order makes the result independent of the order of the bodies.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.backends.numba.geometry import distance_to_fixed, distance_to_point
from marl_airhockey.core.laws import impulse
from marl_airhockey.types import Array

X, Y, VX, VY, SPIN, ANGLE, RADIUS, MASS, EDGE = range(9)
DX, DY, CX, CY, EX, EY, GX, GY, REACH, BEND = range(9, 19)
EARLY_X, EARLY_Y, LATE_X, LATE_Y, FALL, INSIDE, HELD = range(19, 26)
BODY = 26
"""Columns of a body: position, velocity, spin, angle and radius; inverse mass, and
that of a spinning disc's edge (radius squared over its inertia); in the coming drift
its mean velocity with contacts and without, and its velocity at the end; for paddles
the velocity at the end of the step; highest speed (m/s) and acceleration (m/s2) in what
is left of the step; two points that its way lies between, from where it is, and how far
it falls besides (m); for paddles 1 if it began within its reach, and 1 if it could get
out, so that the edges hold it."""

ASKS, PRESCRIBED, PUCK, BLOCK, AWAY, PINNED = range(6)
"""Roles of bodies: a paddle that stops where a puck cannot give way, one that does not;
pucks; blocks; what touches nothing; and a puck that has no room left."""

NX, NY, RESTITUTION, FRICTION = range(4)
"""Columns of a contact: unit normal from the first body to the second, and the laws."""

TINY = 1e-9
"""Closing speed that is none (m/s)."""
SLOP = 2e-4
"""Overlap that is left alone (m)."""
TIMES = 4
"""Number of times that a contact returns its restitution at one moment."""
IMPACTS = 16
"""Number of impacts per contact before a paddle has to stop."""
STOPS = 20
"""Number of inelastic impacts per contact before what still closes stands still."""
MULTIPLE = 3.0
"""A contact leaves no puck faster than the fastest body before, times this."""


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def hide_constant(value: int) -> int:
    """Return an integer that numba does not take for a constant.

    It would compile a function apart for each constant that it is called with.
    """
    return int(np.int64(value))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def distance_between(
    m: Array, i: int, j: int, walls: Array, obstacles: Array
) -> tuple[float, float, float]:
    """Return the gap of body j to body i, or to fixed object -1 - i, and its normal."""
    if i < 0:
        gap, nx, ny = distance_to_fixed(m[j, X], m[j, Y], -1 - i, walls, obstacles)
        return gap - m[j, RADIUS], nx, ny
    dx, dy = m[j, X] - m[i, X], m[j, Y] - m[i, Y]
    gap, nx, ny = distance_to_point(dx, dy)
    return gap - m[i, RADIUS] - m[j, RADIUS], nx, ny


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def closing(m: Array, at: int, i: int, j: int, nx: float, ny: float) -> float:
    """Return the normal speed of j from i, m/s; ``at`` is the column of velocities."""
    speed = nx * m[j, at] + ny * m[j, at + 1]
    if i >= 0:
        speed -= nx * m[i, at] + ny * m[i, at + 1]
    return float(speed)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def strike(
    m: Array,
    at: int,
    i: int,
    j: int,
    contact: tuple[float, float, float, float],
    weights: tuple[float, float, float, float],
) -> None:
    """Apply the impulse law to two bodies in contact.

    The tangent is the normal turned by +90 degrees, spin is counter-clockwise.

    Args:
        m: bodies.
        at: column of the velocities that change.
        i: first body; below 0 for a fixed object.
        j: second body.
        contact: normal from i to j, restitution, friction.
        weights: inverse masses of i and j, and of their edges.
    """
    nx, ny, restitution, friction = contact
    wi, wj, ti, tj = weights
    slip = nx * m[j, at + 1] - ny * m[j, at] - m[j, RADIUS] * m[j, SPIN]
    if i >= 0:
        slip -= nx * m[i, at + 1] - ny * m[i, at] + m[i, RADIUS] * m[i, SPIN]
    speed, mass = -closing(m, at, i, j, nx, ny), wi + wj
    normal, tangential = impulse(
        speed, slip, restitution, friction, mass, mass + ti + tj
    )
    if friction > 0.0:
        m[j, SPIN] -= tj * tangential / m[j, RADIUS]
        if i >= 0:
            m[i, SPIN] -= ti * tangential / m[i, RADIUS]
    x, y = normal * nx - tangential * ny, normal * ny + tangential * nx
    m[j, at] += wj * x
    m[j, at + 1] += wj * y
    if i >= 0:
        m[i, at] -= wi * x
        m[i, at + 1] -= wi * y


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def shares(
    m: Array, role: Array, i: int, j: int, stops: bool
) -> tuple[float, float, float, float]:
    """Return who gives way: inverse masses of two bodies, and of their edges.

    A paddle gives way to another, to the edge of its reach and, if it ``stops``, to a
    puck.
    """
    if role[j] <= PRESCRIBED:
        mine = 1.0 if i >= 0 and role[i] == ASKS else 0.0
        return mine, 1.0 if role[j] == ASKS else 0.0, 0.0, 0.0
    if stops and i >= 0 and role[i] == ASKS:
        return 1.0, 0.0, 0.0, 0.0
    if i < 0:
        return 0.0, m[j, MASS], 0.0, m[j, EDGE]
    return m[i, MASS], m[j, MASS], m[i, EDGE], m[j, EDGE]


@njit(cache=True, nogil=True, error_model="numpy")
def _hardest(
    m: Array, role: Array, at: int, pairs: Array, contacts: Array, n: int, kind: int
) -> int:
    """Return the contact that closes fastest, -1 for none.

    ``kind`` is 0 for contacts of two paddles, 1 for all others, 2 for both.
    """
    worst, found = -TINY, -1
    for c in range(n):
        i, j = pairs[c, 0], pairs[c, 1]
        if role[j] == PINNED or (i >= 0 and role[i] == PINNED):
            continue
        if kind == 2 or (role[j] > PRESCRIBED) == (kind == 1):
            speed = closing(m, at, i, j, contacts[c, NX], contacts[c, NY])
            if speed < worst:
                worst, found = speed, c
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def solve(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    visits: Array,
    kept: Array,
    n: int,
) -> None:
    """Change velocities so that nothing in contact closes.

    Args:
        m: bodies (N, BODY), changed.
        role: roles (N,), changed where a prescribed paddle leaves a puck no room.
        at: column of the velocities that change: VX or DX.
        pairs: bodies of each contact (n or more, 2).
        contacts: (n or more, 4).
        visits: work space (n or more,).
        kept: work space (N, 3).
        n: number of contacts.
    """
    top, paddle = 0.0, False
    for i in range(len(m)):
        kept[i, 0], kept[i, 1], kept[i, 2] = m[i, at], m[i, at + 1], m[i, SPIN]
    for c in range(n):
        visits[c] = 0
        i, j = pairs[c, 0], pairs[c, 1]
        paddle |= role[j] <= PRESCRIBED
        top = max(top, m[j, at] ** 2 + m[j, at + 1] ** 2)
        if i >= 0:
            paddle |= role[i] <= PRESCRIBED
            top = max(top, m[i, at] ** 2 + m[i, at + 1] ** 2)
    if paddle:
        _stop_paddles_at_paddles(m, role, at, pairs, contacts, n)
    calm = at == DX and _rest(m, role, pairs, contacts, n)
    for _ in range(IMPACTS * n if at == VX else 0):
        c = _hardest(m, role, at, pairs, contacts, n, hide_constant(1))
        if c < 0:
            calm = True
            break
        restitution = contacts[c, RESTITUTION] if visits[c] < TIMES else 0.0
        visits[c] += 1
        i, j = pairs[c, 0], pairs[c, 1]
        contact = contacts[c, NX], contacts[c, NY], restitution, contacts[c, FRICTION]
        strike(m, at, i, j, contact, shares(m, role, i, j, False))
    if calm and paddle:
        for i in range(len(m)):
            x, y = m[i, at], m[i, at + 1]
            if role[i] > PRESCRIBED and (x != kept[i, 0] or y != kept[i, 1]):
                calm &= x * x + y * y <= MULTIPLE * MULTIPLE * top + TINY
    if not calm:
        for i in range(len(m) if paddle else 0):
            if role[i] > PRESCRIBED:
                m[i, at], m[i, at + 1], m[i, SPIN] = kept[i, 0], kept[i, 1], kept[i, 2]
        _stop_paddles(m, role, at, pairs, contacts, visits, n)
    for i in range(len(m) if paddle else 0):
        if role[i] == ASKS and (m[i, at] != kept[i, 0] or m[i, at + 1] != kept[i, 1]):
            m[i, HELD] = m[i, INSIDE]


@njit(cache=True, nogil=True, error_model="numpy")
def _rest(m: Array, role: Array, pairs: Array, contacts: Array, n: int) -> bool:
    """Let nothing close in the coming drift; return True if that was found.

    A contact that has pushed does not part within the drift, so that it does no work:
    what a later push took from it, it takes back.
    """
    pushed = np.zeros(n)
    for _ in range(IMPACTS * n):
        worst, found = TINY, -1
        for c in range(n):
            i, j = pairs[c, 0], pairs[c, 1]
            if role[j] > PRESCRIBED and role[j] != PINNED:
                speed = closing(m, DX, i, j, contacts[c, NX], contacts[c, NY])
                error = -speed if speed < 0.0 or pushed[c] == 0.0 else speed
                if error > worst:
                    worst, found = error, c
        if found < 0:
            return True
        i, j = pairs[found, 0], pairs[found, 1]
        nx, ny = contacts[found, NX], contacts[found, NY]
        mine = m[i, MASS] if i >= 0 else 0.0
        push = -closing(m, DX, i, j, nx, ny) / (mine + m[j, MASS])
        push = max(push, -pushed[found])
        pushed[found] += push
        m[j, DX] += push * m[j, MASS] * nx
        m[j, DY] += push * m[j, MASS] * ny
        if i >= 0:
            m[i, DX] -= push * mine * nx
            m[i, DY] -= push * mine * ny
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _stop_paddles_at_paddles(
    m: Array, role: Array, at: int, pairs: Array, contacts: Array, n: int
) -> None:
    """Let paddles that meet share their normal velocity."""
    for _ in range(STOPS * n):
        c = _hardest(m, role, at, pairs, contacts, n, hide_constant(0))
        if c < 0:
            return
        i, j = pairs[c, 0], pairs[c, 1]
        contact = contacts[c, NX], contacts[c, NY], 0.0, 0.0
        strike(m, at, i, j, contact, shares(m, role, i, j, False))


@njit(cache=True, nogil=True, error_model="numpy")
def _stop_paddles(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    visits: Array,
    n: int,
) -> None:
    """Push what is free, without restitution, and stop paddles at what is not."""
    for c in range(n):
        visits[c] = 0
    for count in range(2 * STOPS * n):
        c = _hardest(m, role, at, pairs, contacts, n, hide_constant(2))
        if c < 0:
            return
        i, j = pairs[c, 0], pairs[c, 1]
        puck = role[j] > PRESCRIBED
        if puck and i >= 0 and role[i] == PRESCRIBED and visits[c] >= TIMES:
            role[j] = PINNED
            m[j, at] = m[j, at + 1] = m[j, VX] = m[j, VY] = m[j, SPIN] = 0.0
            continue
        contact = contacts[c, NX], contacts[c, NY], 0.0, 0.0
        if count < STOPS * n:
            strike(m, at, i, j, contact, shares(m, role, i, j, visits[c] > 0))
            visits[c] += 1
            continue
        # A knot: what still closes stands still.
        for k in (i, j):
            if k >= 0 and role[k] != PRESCRIBED:
                m[k, at] = m[k, at + 1] = 0.0


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def fixed_range(
    m: Array, role: Array, j: int, held: int, edges: int, end: int
) -> tuple[int, int]:
    """Return the first fixed object that body j can touch, and the one after the last.

    The edges of its reach are in the way of a paddle that `HELD` marks.

    Args:
        m: bodies.
        role: roles.
        j: body.
        held: number of walls that hold paddles, ``edges`` each, which come first.
        edges: of each paddle's reach.
        end: number of fixed objects.
    """
    if role[j] > PRESCRIBED:
        return held, end
    is_held = role[j] == ASKS and m[j, HELD] > 0.0
    return (j * edges, (j + 1) * edges) if is_held else (0, 0)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def slop(role: Array, i: int, j: int) -> float:
    """Return the overlap of body j with i that is left alone, m: none with an edge."""
    return 0.0 if i < 0 and role[j] <= PRESCRIBED else SLOP


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def partner(place: int, j: int, low: int) -> int:
    """Return what comes at a place in the list of all that body j can touch.

    The bodies before it come first, then its fixed objects, from ``low`` on.
    """
    return place if place < j else -1 - (low + place - j)


@njit(cache=True, nogil=True, error_model="numpy")
def take_apart(
    m: Array, role: Array, walls: Array, obstacles: Array, held: int, edges: int
) -> None:
    """Move overlapping bodies apart: pucks give way, then paddles that ask.

    Args:
        m: bodies, moved.
        role: roles.
        walls: walls.
        obstacles: obstacles.
        held: see `fixed_range`, like the next.
        edges: of each paddle's reach.
    """
    fixed = len(walls) + len(obstacles)
    for sweep in range(100):
        deepest = 0.0
        for j in range(len(m)):
            # Fixed objects last, which no body is left in.
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


@njit(cache=True, nogil=True, error_model="numpy")
def keep_in_reach(m: Array, walls: Array, paddles: int, edges: int) -> None:
    """Move paddles that could get out of their reaches back to the edge."""
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
