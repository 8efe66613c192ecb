"""What returns speed in a contact, in MuJoCo's terms."""

from __future__ import annotations

import numpy as np

from marl_airhockey.types import Array

STIFFNESS = 0.19
"""Root of a contact's stiffness times the time step. In a stiffer one the first step,
which is partial, counts more: what returns depends on the moment of the contact. In a
softer one bodies go deeper into each other."""
MOMENTS = 32
LONGEST = 200
"""Steps, of any contact"""


def restitution_of(ratio: Array) -> Array:
    """The share of the speed that a damped spring returns which can only push.

    Taken step by step, as MuJoCo's integrator does, for contacts that begin at any
    moment within a step; halfway between the least and the most of them.

    Args:
        ratio: (N,) damping ratios.

    Returns:
        (N,) shares.
    """
    # In units of the time step and of the speed before.
    begun = -(np.arange(MOMENTS) + 0.5) / MOMENTS
    depth = np.broadcast_to(begun, (len(ratio), MOMENTS)).copy()
    speed = -np.ones_like(depth)
    damping = 2 * ratio[:, None] * STIFFNESS
    for _ in range(LONGEST):
        push = np.maximum(-(STIFFNESS**2) * depth - damping * speed, 0.0)
        speed += np.where(depth < 0, push, 0.0)
        depth += speed
    return np.asarray((speed.min(1) + speed.max(1)) / 2)


_RATIOS = np.geomspace(1e-5, 2.0, 500)
_SHARES = restitution_of(_RATIOS)


def solref(restitution: float, timestep: float) -> Array:
    """(2,) direct solref of a contact that returns a share of the normal speed."""
    ratio = np.interp(-restitution, -_SHARES, _RATIOS)
    stiffness = (STIFFNESS / timestep) ** 2
    return np.array([-stiffness, -2 * ratio * np.sqrt(stiffness)])
