"""Impacts: the solver for all contacts of a moment.

Contacts are solved one after the other as impacts of two bodies, the fastest first. An
impact conserves momentum and does not add energy. With the fastest first, the result
does not depend on the order of the bodies.

If this does not end soon, or makes a puck faster than an impact can, `contact_solver`
solves all contacts together. A paddle that follows commands then yields to a pinned
puck.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.bodies import (
    ASKS,
    DX,
    DY,
    HELD,
    INSIDE,
    MASS,
    NX,
    NY,
    PINNED,
    PRESCRIBED,
    PUCK,
    RESTITUTION,
    SPIN,
    TINY,
    VX,
    VY,
    closing,
    shares,
)
from marl_airhockey.sim.backends.numba.contact_solver import ALL, PADDLES, push
from marl_airhockey.sim.backends.numba.impulses import hardest, impact, strike
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

TIMES = 4
"""Number of impacts with restitution of one contact at one moment."""
IMPACTS = 6
"""Number of impacts per contact before all contacts are solved together."""
DIRECT = 2
"""Number of impacts per contact of paddles before these are solved together."""
FAST = 0.1
"""Closing speed above which contacts in a jam bounce, m/s."""
STOPS = 20
"""Number of inelastic impacts per contact before bodies that still close stop."""
MULTIPLE = 3.0
"""Largest ratio of a puck's speed after contacts to the fastest body's speed before."""


@inner(error_model="numpy")
def solve(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    visits: Array,
    kept: Array,
    n: int,
    jam: bool,
) -> bool:
    """Change velocities so that no contact closes.

    Args:
        m: Bodies (N, BODY), changed.
        role: Roles of the bodies (N,), changed if a position-driven paddle pins a puck.
        at: First column of the velocities that change: VX or DX.
        pairs: Bodies of each contact (n or more, 2).
        contacts: Contacts (n or more, CONTACT).
        visits: Work space (n or more,).
        kept: Work space (N, 3).
        n: Number of contacts.
        jam: True if paddles have yielded to pucks in this step.

    Returns:
        True if paddles have yielded.
    """
    i, j = pairs[0, 0], pairs[0, 1]
    if n == 1 and at == VX and i < 0 and role[j] == PUCK:
        # The most frequent case, a puck at a wall, needs one impact.
        impact(m, role, at, pairs, contacts, 0, contacts[0, RESTITUTION], True)
        return jam
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
    jam &= paddle
    calm = False
    if jam and at == VX:
        _bounce(m, role, at, pairs, contacts, visits, n, n, FAST)
    elif not jam:
        if paddle:
            _stop_paddles_at_paddles(m, role, at, pairs, contacts, n)
        if at == VX:
            most = IMPACTS * n
            calm = _bounce(m, role, at, pairs, contacts, visits, n, most, TINY)
        else:
            calm = _rest(m, role, pairs, contacts, n)
    slow = True
    for i in range(len(m) if paddle else 0):
        x, y = m[i, at], m[i, at + 1]
        if role[i] > PRESCRIBED and (x != kept[i, 0] or y != kept[i, 1]):
            slow &= x * x + y * y <= MULTIPLE * MULTIPLE * top + TINY
    calm &= slow
    if not calm:
        for i in range(len(m) if paddle and not (jam and slow) else 0):
            if role[i] > PRESCRIBED:
                m[i, at], m[i, at + 1], m[i, SPIN] = kept[i, 0], kept[i, 1], kept[i, 2]
        if not push(m, role, at, pairs, contacts, n, ALL):
            _stop_paddles(m, role, at, pairs, contacts, visits, n)
    for i in range(len(m) if paddle else 0):
        if role[i] == ASKS and (m[i, at] != kept[i, 0] or m[i, at + 1] != kept[i, 1]):
            m[i, HELD] = m[i, INSIDE]
    return jam or (paddle and not calm)


@inner(error_model="numpy")
def _bounce(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    visits: Array,
    n: int,
    most: int,
    least: float,
) -> bool:
    """Apply impacts to the contact that closes fastest, up to ``most`` times.

    Return True if no contact closes faster than ``least`` m/s afterwards.
    """
    for _ in range(most):
        c = hardest(m, role, at, pairs, contacts, n, 1, least)
        if c < 0:
            return True
        restitution = contacts[c, RESTITUTION] if visits[c] < TIMES else 0.0
        visits[c] += 1
        impact(m, role, at, pairs, contacts, c, restitution, visits[c] == 1)
    return False


@inner(error_model="numpy")
def _rest(m: Array, role: Array, pairs: Array, contacts: Array, n: int) -> bool:
    """Change the velocities of the next move so that no contact closes.

    A contact with an impulse does not open within the move, so that it does no work.
    Its impulse is reduced if later impulses make it open. Return True on success.
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
        size = -closing(m, DX, i, j, nx, ny) / (mine + m[j, MASS])
        size = max(size, -pushed[found])
        pushed[found] += size
        m[j, DX] += size * m[j, MASS] * nx
        m[j, DY] += size * m[j, MASS] * ny
        if i >= 0:
            m[i, DX] -= size * mine * nx
            m[i, DY] -= size * mine * ny
    return False


@inner(error_model="numpy")
def _stop_paddles_at_paddles(
    m: Array, role: Array, at: int, pairs: Array, contacts: Array, n: int
) -> None:
    """Give paddles in contact a common normal velocity."""
    for count in range(STOPS * n):
        c = hardest(m, role, at, pairs, contacts, n, 0, TINY)
        if c < 0 or (
            count == DIRECT * n and push(m, role, at, pairs, contacts, n, PADDLES)
        ):
            return
        i, j = pairs[c, 0], pairs[c, 1]
        contact = contacts[c, NX], contacts[c, NY], 0.0, 0.0
        strike(m, at, i, j, contact, shares(m, role, i, j, False))


@inner(error_model="numpy")
def _stop_paddles(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    visits: Array,
    n: int,
) -> None:
    """Push free bodies without restitution, and stop paddles at immovable ones."""
    for c in range(n):
        visits[c] = 0
    for count in range(2 * STOPS * n):
        c = hardest(m, role, at, pairs, contacts, n, 2, TINY)
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
        # No solution was found: stop the bodies that still close.
        for k in (i, j):
            if k >= 0 and role[k] != PRESCRIBED:
                m[k, at] = m[k, at + 1] = 0.0
