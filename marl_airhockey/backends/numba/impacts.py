"""Impacts: one impulse law, and the solver for all contacts of a moment.

Contacts are solved as impacts of two bodies, one after the other and the hardest first.
Each conserves momentum and takes energy, so all of them do. Where that does not end,
or makes a puck faster than any blow could, a paddle that asks for a velocity stops.
The hardest-first order makes the result independent of the order of the bodies.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.backends.numba.bodies import (
    ASKS,
    DX,
    DY,
    HELD,
    INSIDE,
    MASS,
    PINNED,
    PRESCRIBED,
    PUCK,
    RADIUS,
    SPIN,
    VX,
    VY,
    closing,
    hide_constant,
    shares,
)
from marl_airhockey.core.laws import impulse
from marl_airhockey.jit.cache import compiled
from marl_airhockey.types import Array

NX, NY, RESTITUTION, FRICTION, KICK = range(5)
CONTACT = 5
"""Columns of a contact: unit normal from the first body to the second, the laws, and
what scatter adds to the puck: speed along a wall (m/s), or at a paddle speed of the
edge per speed of the puck."""

TINY = 1e-9
"""Closing speed that is none (m/s)."""
TIMES = 4
"""Number of times that a contact returns its restitution at one moment."""
IMPACTS = 16
"""Number of impacts per contact before a paddle has to stop."""
STOPS = 20
"""Number of inelastic impacts per contact before what still closes stands still."""
MULTIPLE = 3.0
"""A contact leaves no puck faster than the fastest body before, times this."""


@compiled(nogil=True, error_model="numpy", forceinline=True)
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


@compiled(nogil=True, error_model="numpy", forceinline=True)
def scatter(
    m: Array, at: int, i: int, j: int, nx: float, ny: float, kick: float
) -> None:
    """Add to a puck what its contact scatters, see `KICK`."""
    if i < 0:
        m[j, at] -= kick * ny
        m[j, at + 1] += kick * nx
    else:
        speed = np.sqrt(m[j, at] ** 2 + m[j, at + 1] ** 2)
        m[j, SPIN] += kick * speed / m[j, RADIUS]


@compiled(nogil=True, error_model="numpy")
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


@compiled(nogil=True, error_model="numpy")
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
        contacts: (n or more, CONTACT).
        visits: work space (n or more,).
        kept: work space (N, 3).
        n: number of contacts.
    """
    i, j = pairs[0, 0], pairs[0, 1]
    if n == 1 and at == VX and i < 0 and role[j] == PUCK:
        # Most often a puck meets a wall, which one impact settles.
        nx, ny = contacts[0, NX], contacts[0, NY]
        contact = nx, ny, contacts[0, RESTITUTION], contacts[0, FRICTION]
        strike(m, at, i, j, contact, shares(m, role, i, j, False))
        if contacts[0, KICK] != 0.0:
            scatter(m, at, i, j, nx, ny, contacts[0, KICK])
        return
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
        if visits[c] == 1 and contacts[c, KICK] != 0.0:
            scatter(m, at, i, j, contact[0], contact[1], contacts[c, KICK])
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


@compiled(nogil=True, error_model="numpy")
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


@compiled(nogil=True, error_model="numpy")
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


@compiled(nogil=True, error_model="numpy")
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
