"""Contact noise: random deviation of a single contact of a puck from the contact model.

The random numbers of a contact depend only on the key of its world and the number of
the collision. A world of a batch therefore gets the same numbers as a single world. The
model and the noise were measured on two real tables, see docs/physics.md.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.parameters import SLOWEST_BOUNCE
from marl_airhockey.sim.core.rng import GOLDEN, mix, normal_pair
from marl_airhockey.sim.jit.cache import compiled

TAIL, WIDER = 0.05, 5.0
"""Share of bounces with more noise of the exit speed, and the factor of this noise,
from the records of one table."""
_UNIT = 2.0**-53
_11 = np.uint64(11)


@compiled(nogil=True, error_model="numpy")
def draw(key: np.uint64, number: int, place: int) -> tuple[float, float, float]:
    """Return two standard normal numbers and one uniform in [0, 1) for a contact.

    Args:
        key: Key of the world.
        number: Number of the collision.
        place: Index that distinguishes simultaneous contacts.
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
    """Return the restitution of a bounce, and the speed that it adds along the wall.

    Args:
        sample: Result of `draw`.
        speed: Closing speed, m/s. Bounces slower than the measured ones add less speed.
        e: Restitution by the contact model.
        sd: Standard deviation of the restitution.
        exit_sd: Standard deviation of the added speed, m/s.
    """
    wide = WIDER if sample[2] < TAIL else 1.0
    share = min(speed / SLOWEST_BOUNCE, 1.0)
    return min(max(e + sd * sample[0], 0.0), 1.0), wide * exit_sd * sample[1] * share


@compiled(nogil=True, error_model="numpy")
def at_paddle(
    sample: tuple[float, float, float], e: float, sd: float, spin_sd: float
) -> tuple[float, float]:
    """Return the restitution, and the edge speed per speed of the puck after a hit."""
    return min(max(e + sd * sample[0], 0.0), 1.0), spin_sd * sample[1]
