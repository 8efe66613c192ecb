"""Impulses: the impact of two bodies, and the contact that closes fastest."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.bodies import (
    FRICTION,
    KICK,
    NX,
    NY,
    PINNED,
    PRESCRIBED,
    RADIUS,
    SPIN,
    closing,
    shares,
)
from marl_airhockey.sim.core.laws import impulse
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array


@inner(error_model="numpy", forceinline=True)
def strike(
    m: Array,
    at: int,
    i: int,
    j: int,
    contact: tuple[float, float, float, float],
    weights: tuple[float, float, float, float],
) -> None:
    """Apply the impulse of an impact to two bodies in contact.

    The tangent is the normal, rotated by +90 degrees. Spin is counter-clockwise.

    Args:
        m: Bodies (N, BODY), changed.
        at: First column of the velocities that change.
        i: Index of the first body; below 0 for a fixed object.
        j: Index of the second body.
        contact: Unit normal from i to j, restitution and friction (4 values).
        weights: Inverse masses of i and j, and of their edges (4 values).
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


@inner(error_model="numpy", forceinline=True)
def scatter(
    m: Array, at: int, i: int, j: int, nx: float, ny: float, kick: float
) -> None:
    """Add the contact noise to the motion of a puck, see `bodies.KICK`."""
    if i < 0:
        m[j, at] -= kick * ny
        m[j, at + 1] += kick * nx
    else:
        speed = np.sqrt(m[j, at] ** 2 + m[j, at + 1] ** 2)
        m[j, SPIN] += kick * speed / m[j, RADIUS]


@inner(error_model="numpy", forceinline=True)
def impact(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    c: int,
    restitution: float,
    first: bool,
) -> None:
    """Apply one impact to contact ``c``, with contact noise if it is the first one."""
    i, j, nx, ny = pairs[c, 0], pairs[c, 1], contacts[c, NX], contacts[c, NY]
    contact = nx, ny, restitution, contacts[c, FRICTION]
    strike(m, at, i, j, contact, shares(m, role, i, j, False))
    if first and contacts[c, KICK] != 0.0:
        scatter(m, at, i, j, nx, ny, contacts[c, KICK])


@inner(error_model="numpy")
def hardest(
    m: Array,
    role: Array,
    at: int,
    pairs: Array,
    contacts: Array,
    n: int,
    kind: int,
    least: float,
) -> int:
    """Return the contact that closes fastest; -1 if all are slower than ``least`` m/s.

    ``kind`` is 0 for contacts of two paddles, 1 for all other contacts, 2 for both.
    """
    worst, found = -least, -1
    for c in range(n):
        i, j = pairs[c, 0], pairs[c, 1]
        if role[j] == PINNED or (i >= 0 and role[i] == PINNED):
            continue
        if kind == 2 or (role[j] > PRESCRIBED) == (kind == 1):
            speed = closing(m, at, i, j, contacts[c, NX], contacts[c, NY])
            if speed < worst:
                worst, found = speed, c
    return found
