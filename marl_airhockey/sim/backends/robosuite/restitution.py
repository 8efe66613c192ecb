"""Restitution of contacts as contact parameters of MuJoCo."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array

STIFFNESS = 0.19
"""Square root of a contact's stiffness, times the time step. The first step of a
contact is partial. In a stiffer contact it matters more, so that the restitution
depends on the time of the contact within a step. In a softer contact, bodies overlap
more."""
IMPEDANCE = 0.5
"""Impedance d of contacts (solimp). A share 1 - d of each contact is a spring with a
mass of its own, so that a puck stays soft if a paddle jams it against a rail. With d
near 1, MuJoCo pushes the arm back as stiffly as the puck, with more than 200 N. This
tilts the paddle."""
PHASES = 32
"""Number of simulated times within a step at which contacts begin."""
MAX_STEPS = 200
"""Longest simulated contact, in steps."""


def restitution_of(ratio: Array) -> Array:
    """Compute the restitution of damped springs that only push.

    The integration is that of MuJoCo, for contacts that begin at different times within
    a step. The result is halfway between the smallest and the largest restitution.

    Args:
        ratio: Damping ratios (N,).

    Returns:
        Restitutions (N,).
    """
    # The units are the time step and the speed before the contact.
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
    """Return solref in its direct form (..., 2) for restitutions (...)."""
    ratio = np.interp(-np.asarray(restitution), -_SHARES, _RATIOS)
    # MuJoCo divides both numbers by the impedance and applies a share of them. The
    # share is not the impedance, because MuJoCo averages the inverse mass over three
    # axes. For a body that slides along two axes, the mean is two thirds of its inverse
    # mass.
    applied = IMPEDANCE / (IMPEDANCE + (1.0 - IMPEDANCE) * 2.0 / 3.0)
    scale = IMPEDANCE / applied
    stiffness = (STIFFNESS / timestep) ** 2
    damping = -2 * ratio * np.sqrt(stiffness) * scale
    return np.stack([np.full_like(damping, -stiffness * scale), damping], -1)
