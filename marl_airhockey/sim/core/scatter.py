"""Scatter: how far one contact of a puck lies from the laws, from a counter alone.

What a contact draws follows from the key of its world and the number of the collision,
so a row of many worlds draws what the single world does. Laws and spread were measured
on two real tables, see the documentation of the physics.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.parameters import SLOWEST_BOUNCE
from marl_airhockey.sim.core.rng import GOLDEN, mix, normal_pair
from marl_airhockey.sim.jit.cache import compiled

TAIL, WIDER = 0.05, 5.0
"""Share of bounces whose exit scatters more, and how much more: one table's records."""
_UNIT = 2.0**-53
_11 = np.uint64(11)


@compiled(nogil=True, error_model="numpy")
def draw(key: np.uint64, number: int, place: int) -> tuple[float, float, float]:
    """Return two standard normal numbers and one in [0, 1) of a contact.

    Args:
        key: of the world.
        number: of the collision.
        place: tells contacts of one moment from each other.
    """
    first = mix(mix(key + np.uint64(number + 1) * GOLDEN) ^ np.uint64(place))
    second, third = mix(first + GOLDEN), mix(first + GOLDEN + GOLDEN)
    units = (first >> _11) * _UNIT, (second >> _11) * _UNIT, (third >> _11) * _UNIT
    one, two = normal_pair(units[0], units[1])
    return one, two, units[2]


@compiled(nogil=True, error_model="numpy")
def at_wall(
    sample: tuple[float, float, float],
    speed: float,
    e: float,
    sd: float,
    exit_sd: float,
) -> tuple[float, float]:
    """Return restitution and speed along the wall, m/s, that a bounce adds.

    Args:
        sample: what `draw` returned.
        speed: closing speed, m/s; slower bounces than were measured scatter less.
        e: restitution by the law.
        sd: of the restitution.
        exit_sd: of the speed along the wall, m/s.
    """
    wide = WIDER if sample[2] < TAIL else 1.0
    share = min(speed / SLOWEST_BOUNCE, 1.0)
    return min(max(e + sd * sample[0], 0.0), 1.0), wide * exit_sd * sample[1] * share


@compiled(nogil=True, error_model="numpy")
def at_paddle(
    sample: tuple[float, float, float], e: float, sd: float, spin_sd: float
) -> tuple[float, float]:
    """Return restitution, and speed of the edge per speed of the puck after the hit."""
    return min(max(e + sd * sample[0], 0.0), 1.0), spin_sd * sample[1]
