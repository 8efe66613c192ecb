"""Filters of commands: what smooths a policy's velocities before the shaper.

A policy commands a new velocity in every control step, 20 times a second; a filter says
which velocity the shaper is to reach, and when, in each of the driver's cycles. The
shaper's limits hold whatever comes out here. `scripts/reproduce/smoothing.py` compares
the filters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.types import Array


class Target(NamedTuple):
    """Target of the shaper."""

    velocity: Array
    """(2,) m/s"""
    seconds: float
    """Time in which it is to be reached by a linear ramp, s; 0 for immediately"""


class Filter(Protocol):
    """Filter of the commands of one paddle."""

    def step(self, velocity: Array, left: float) -> Target:
        """Return the target of a cycle.

        Args:
            velocity: (2,) commanded velocity, m/s, finite.
            left: Time until the command is to be reached, s.
        """

    def reset(self, velocity: Array) -> None:
        """Begin at a velocity (2,), m/s, with no acceleration."""


class NoFilter:
    """Filter that passes commands on: a linear ramp over the control step.

    Args:
        dt: Time of a cycle, s.
        time: Not used.
    """

    def __init__(self, dt: float, time: float) -> None:
        """Keep nothing."""

    def reset(self, velocity: Array) -> None:
        """Keep nothing."""

    def step(self, velocity: Array, left: float) -> Target:
        return Target(velocity, left)


class LowPass:
    """First-order low pass.

    Args:
        dt: Time of a cycle, s.
        time: Time constant, s.
    """

    def __init__(self, dt: float, time: float) -> None:
        self._share = dt / (time + dt)
        self._velocity = np.zeros(2)

    def reset(self, velocity: Array) -> None:
        self._velocity = np.array(velocity)

    def step(self, velocity: Array, left: float) -> Target:
        self._velocity = self._velocity + self._share * (velocity - self._velocity)
        return Target(self._velocity, left)


class JerkLimited:
    """Filter that reaches each command with a limited jerk.

    Args:
        dt: Time of a cycle, s.
        time: Time in which the acceleration rises from 0 to `ACCELERATION`, s.
    """

    ACCELERATION = 7.0
    """Largest acceleration, m/s2"""

    def __init__(self, dt: float, time: float) -> None:
        self._dt, self._jerk = dt, self.ACCELERATION / max(time, dt)
        self._velocity, self._acceleration = np.zeros(2), np.zeros(2)

    def reset(self, velocity: Array) -> None:
        self._velocity, self._acceleration = np.array(velocity), np.zeros(2)

    def step(self, velocity: Array, left: float) -> Target:
        change = velocity - self._velocity
        size = float(np.linalg.norm(change))
        # The acceleration from which the jerk ends just at the command, in cycles.
        brake = self._jerk * self._dt
        most = 0.5 * (np.sqrt(brake**2 + 8.0 * self._jerk * size) - brake)
        pull = change / max(size, 1e-9) * min(self.ACCELERATION, most, size / self._dt)
        jerk = pull - self._acceleration
        length = float(np.linalg.norm(jerk))
        self._acceleration = self._acceleration + jerk * min(
            1.0, self._jerk * self._dt / max(length, 1e-12)
        )
        self._velocity = self._velocity + self._acceleration * self._dt
        return Target(self._velocity, 0.0)


class MinimumJerk:
    """Filter that reaches each command with the least integral of the squared jerk.

    From a velocity and an acceleration to the commanded velocity without acceleration
    that is a cubic polynomial of time, over the rest of the control step and ``time``.
    As each command plans anew, a step is passed by up to 2 % before it is reached.

    Args:
        dt: Time of a cycle, s.
        time: Time by which the end of the control step is extended, s.
    """

    def __init__(self, dt: float, time: float) -> None:
        self._dt, self._time = dt, time
        self._velocity, self._acceleration = np.zeros(2), np.zeros(2)

    def reset(self, velocity: Array) -> None:
        self._velocity, self._acceleration = np.array(velocity), np.zeros(2)

    def step(self, velocity: Array, left: float) -> Target:
        span = max(left + self._time, self._dt)
        change, s = velocity - self._velocity, self._dt / span
        # Hermite polynomial of the velocity; its end has no slope.
        slope = self._acceleration * span
        second, third = 3.0 * change - 2.0 * slope, slope - 2.0 * change
        moved = slope * s + second * s**2 + third * s**3
        self._acceleration = (slope + 2.0 * second * s + 3.0 * third * s**2) / span
        self._velocity = self._velocity + moved
        return Target(self._velocity, 0.0)


FILTERS: dict[str, Callable[[float, float], Filter]] = {
    "none": NoFilter,
    "low_pass": LowPass,
    "jerk_limited": JerkLimited,
    "minimum_jerk": MinimumJerk,
}
"""Filters by name"""


@dataclass(frozen=True)
class Smoothing:
    """Choice of a filter.

    Raises:
        ValueError: An unknown name, or a time that is not 0 to 1 s.
    """

    name: str = "none"
    """Name of one of `FILTERS`"""
    time: float = 0.05
    """Its time, s"""

    def __post_init__(self) -> None:
        check_fields(self, time=(0.0, 1.0))
        if self.name not in FILTERS:
            raise ValueError("name: " + unknown_name("filter", self.name, FILTERS))

    def make(self, dt: float) -> Filter:
        """Return the filter.

        Args:
            dt: Time of a cycle, s.
        """
        return FILTERS[self.name](dt, self.time)
