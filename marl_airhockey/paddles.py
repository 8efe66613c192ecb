"""How two paddles meet: one law for every 2D backend."""

from __future__ import annotations

import numpy as np

from marl_airhockey.state import Array


def meet(position: Array, velocity: Array, told: Array, diameter: float) -> bool:
    """Separate overlapping paddles in place; True if any pair overlapped.

    Each goes back by half of the overlap and both take the mean of their normal
    velocities. A told paddle does not yield: the other goes back by all of it and takes
    the told one's normal velocity.

    Args:
        position: (paddles, 2) m, changed in place.
        velocity: (paddles, 2) m/s, changed in place.
        told: (paddles,) bool.
        diameter: distance of two centres in contact, m.
    """
    met = False
    for i in range(len(position) - 1):
        for j in range(i + 1, len(position)):
            gap = position[j] - position[i]
            distance = float(np.hypot(gap[0], gap[1]))
            if distance >= diameter or (told[i] and told[j]):
                continue
            met = True
            normal = gap / distance if distance > 1e-9 else np.array([1.0, 0.0])
            share = 0.5 if told[i] == told[j] else float(told[j])
            position[i] -= share * (diameter - distance) * normal
            position[j] += (1 - share) * (diameter - distance) * normal
            vi, vj = float(velocity[i] @ normal), float(velocity[j] @ normal)
            if vi > vj:
                common = (1 - share) * vi + share * vj
                velocity[i] += (common - vi) * normal
                velocity[j] += (common - vj) * normal
    return met
