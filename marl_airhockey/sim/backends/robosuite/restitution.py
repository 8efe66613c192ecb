"""Restitution of contacts, as parameters of MuJoCo."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array

STIFFNESS = 0.19
"""Root of a contact's stiffness times the time step. In a stiffer one the first step,
which is partial, counts more: the restitution depends on the time of the contact within
a step. In a softer one bodies overlap more."""
IMPEDANCE = 0.5
"""Impedance d of contacts (solimp). A share 1 - d of each is a spring of its own mass,
so a puck that a paddle jams against a rail stays soft. With d near 1, MuJoCo pushed the
arm back as stiffly as the puck: with more than 200 N, which tipped the paddle."""
PHASES = 32
"""Number of times within a step at which contacts begin."""
MAX_STEPS = 200
"""Longest contact, in steps."""


def restitution_of(ratio: Array) -> Array:
    """Compute the share of the speed that a damped spring, which only pushes, returns.

    It is integrated as by MuJoCo, for contacts that begin at any time within a step;
    the result is halfway between the least and the greatest share.

    Args:
        ratio: (N,) damping ratios.

    Returns:
        (N,) shares.
    """
    # Units: the time step and the speed before the contact.
    begun = -(np.arange(PHASES) + 0.5) / PHASES
    depth = np.broadcast_to(begun, (len(ratio), PHASES)).copy()
    speed = -np.ones_like(depth)
    damping = 2 * ratio[:, None] * STIFFNESS
    for _ in range(MAX_STEPS):
        push = np.maximum(-(STIFFNESS**2) * depth - damping * speed, 0.0)
        speed += np.where(depth < 0, push, 0.0)
        depth += speed
    return np.asarray((speed.min(1) + speed.max(1)) / 2)


_RATIOS = np.geomspace(1e-5, 2.0, 500)
_SHARES = restitution_of(_RATIOS)


def solref(restitution: float | Array, timestep: float) -> Array:
    """Return the direct solref (..., 2) of contacts with restitutions (...)."""
    ratio = np.interp(-np.asarray(restitution), -_SHARES, _RATIOS)
    # MuJoCo divides both by the impedance and applies a share of them. That were the
    # impedance again, but the inverse mass that it uses is a mean over three
    # axes: two thirds of that of a body which slides along two.
    applied = IMPEDANCE / (IMPEDANCE + (1.0 - IMPEDANCE) * 2.0 / 3.0)
    scale = IMPEDANCE / applied
    stiffness = (STIFFNESS / timestep) ** 2
    damping = -2 * ratio * np.sqrt(stiffness) * scale
    return np.stack([np.full_like(damping, -stiffness * scale), damping], -1)
