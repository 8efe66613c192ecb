"""What returns speed in a contact, in MuJoCo's terms."""

from __future__ import annotations

import numpy as np

from marl_airhockey.state import Array

STIFFNESS = 0.2
"""Root of a contact's stiffness times the time step. In a stiffer one the first step,
which is partial, counts: what returns then depends on the moment of the contact."""


def returned(ratio: Array) -> Array:
    """The share of the speed that a damped spring returns which can only push.

    It lets go when its force has come down to nothing, before it is back at its length
    (Schwager and Poeschel, 2007).

    Args:
        ratio: damping ratio, above 0 and not 1.
    """
    root = np.sqrt(np.abs(1 - ratio**2))
    under = np.arctan2(2 * ratio * root, 2 * ratio**2 - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        over = np.log((ratio + root) / (ratio - root))
    return np.asarray(np.exp(-ratio / root * np.where(ratio < 1, under, over)))


_RATIOS = np.geomspace(1e-5, 9.9, 2000)
_SHARES = returned(_RATIOS)


def solref(restitution: float, timestep: float) -> Array:
    """(2,) direct solref of a contact that returns a share of the normal speed."""
    ratio = np.interp(-restitution, -_SHARES, _RATIOS)
    stiffness = (STIFFNESS / timestep) ** 2
    return np.array([-stiffness, -2 * ratio * np.sqrt(stiffness)])
