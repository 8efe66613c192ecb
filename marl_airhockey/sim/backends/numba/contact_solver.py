"""Contact solver: impulses at all contacts of a moment, solved together.

Contacts have no restitution here. The impulses are the smallest with which no contact
closes (Gauss' principle). A contact with an impulse neither closes nor opens. A contact
without an impulse may open.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.bodies import (
    ASKS,
    MASS,
    NX,
    NY,
    PINNED,
    PRESCRIBED,
    TINY,
    closing,
)
from marl_airhockey.sim.backends.numba.complementarity import complement
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

PADDLES, ALL = range(2)
"""Contacts that are solved: contacts of paddles with paddles and with the edges of
their workspaces, or all contacts. A paddle with the role `ASKS` has the mass of the
lightest other body."""
CLOSES = 1e-6
"""Closing speed from which on a result is not a solution, m/s."""


@inner(error_model="numpy")
def push(
    m: Array, role: Array, at: int, pairs: Array, contacts: Array, n: int, who: int
) -> bool:
    """Change velocities by the smallest impulses with which no contact closes.

    Args:
        m: Bodies (N, BODY), changed.
        role: Roles of the bodies (N,).
        at: First column of the velocities that change.
        pairs: Bodies of each contact (n or more, 2).
        contacts: Contacts (n or more, CONTACT).
        n: Number of contacts.
        who: Contacts that are solved, `PADDLES` or `ALL`.

    Returns:
        True if such impulses exist; otherwise all velocities are unchanged.
    """
    weight, lightest = np.zeros(len(m)), 0.0
    for i in range(len(m)):
        if PRESCRIBED < role[i] < PINNED and who == ALL:
            weight[i] = m[i, MASS]
            lightest = max(lightest, m[i, MASS])
    for i in range(len(m)):
        if role[i] == ASKS:
            weight[i] = lightest if lightest > 0.0 else 1.0
    # Contacts, and factors that scale each of them to an effective mass of 1.
    which, scale, count = np.empty(n, np.int64), np.empty(n), 0
    for c in range(n):
        i, j = pairs[c, 0], pairs[c, 1]
        pinned = role[j] == PINNED or (i >= 0 and role[i] == PINNED)
        if pinned or (who == PADDLES and role[j] > PRESCRIBED):
            continue
        mass = weight[j] + (weight[i] if i >= 0 else 0.0)
        if mass > 0.0:
            which[count], scale[count] = c, 1.0 / np.sqrt(mass)
            count += 1
        elif closing(m, at, i, j, contacts[c, NX], contacts[c, NY]) < -TINY:
            return False
    tableau = np.empty((count, count + 2))
    for k in range(count):
        c = which[k]
        i, j, nx, ny = pairs[c, 0], pairs[c, 1], contacts[c, NX], contacts[c, NY]
        tableau[k, count] = 1.0
        tableau[k, count + 1] = scale[k] * closing(m, at, i, j, nx, ny)
        for other in range(k + 1):
            d = which[other]
            p, q = pairs[d, 0], pairs[d, 1]
            common = weight[j] if j == q else 0.0
            if i >= 0:
                common += (weight[i] if i == p else 0.0) - (weight[i] if i == q else 0)
            common -= weight[j] if j == p else 0.0
            common *= scale[k] * scale[other]
            common *= nx * contacts[d, NX] + ny * contacts[d, NY]
            tableau[k, other] = tableau[other, k] = common
    if not complement(tableau, np.empty(2 * count + 1, np.int64), count):
        return False
    solved = True
    for sign in (1.0, -1.0):
        for k in range(count):
            c = which[k]
            i, j = pairs[c, 0], pairs[c, 1]
            size = sign * scale[k] * tableau[k, 0]
            x, y = size * contacts[c, NX], size * contacts[c, NY]
            m[j, at] += weight[j] * x
            m[j, at + 1] += weight[j] * y
            if i >= 0:
                m[i, at] -= weight[i] * x
                m[i, at + 1] -= weight[i] * y
        for k in range(count if sign > 0.0 else 0):
            c = which[k]
            nx, ny = contacts[c, NX], contacts[c, NY]
            solved &= closing(m, at, pairs[c, 0], pairs[c, 1], nx, ny) > -CLOSES
        if solved:
            break
    return solved
