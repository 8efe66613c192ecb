"""Filters that smooth the velocities of a policy before the shaper.

A policy commands a new velocity in every control step, 20 times a second. In each cycle
of the robot client, a filter returns the velocity that the shaper has to reach, and the
time until then. The limits of the shaper apply to any output of a filter.
`scripts/reproduce/smoothing.py` compares the filters.
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
    """Velocity (2,), m/s."""
    seconds: float
    """Time of a linear ramp to the velocity, s; 0 for immediately."""


class Filter(Protocol):
    """Filter of the commands of one paddle."""

    def step(self, velocity: Array, left: float) -> Target:
        """Return the target of a cycle.

        Args:
            velocity: Commanded velocity (2,), m/s, finite.
            left: Time until the commanded velocity has to be reached, s.
        """

    def reset(self, velocity: Array) -> None:
        """Restart at a velocity (2,), m/s, without acceleration."""


class NoFilter:
    """Filter that does not change commands: a linear ramp over the control step.

    Args:
        dt: Time of a cycle, s.
        time: Not used.
    """

    def __init__(self, dt: float, time: float) -> None:
        """Do nothing."""

    def reset(self, velocity: Array) -> None:
        """Do nothing."""

    def step(self, velocity: Array, left: float) -> Target:
        return Target(velocity, left)


class LowPass:
    """First-order low-pass filter.

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
    """Largest acceleration, m/s2."""

    def __init__(self, dt: float, time: float) -> None:
        self._dt, self._jerk = dt, self.ACCELERATION / max(time, dt)
        self._velocity, self._acceleration = np.zeros(2), np.zeros(2)

    def reset(self, velocity: Array) -> None:
        self._velocity, self._acceleration = np.array(velocity), np.zeros(2)

    def step(self, velocity: Array, left: float) -> Target:
        change = velocity - self._velocity
        size = float(np.linalg.norm(change))
        # Acceleration from which the limited jerk ends exactly at the command.
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

    The velocity is a cubic polynomial of time. It begins with the present velocity and
    acceleration and ends at the commanded velocity without acceleration. It lasts for
    the rest of the control step plus ``time``. Each command starts a new polynomial, so
    a step response overshoots by up to 2 %.

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
"""Filters by name."""


@dataclass(frozen=True)
class Smoothing:
    """Choice of a filter.

    Raises:
        ValueError: The name is unknown, or the time is outside 0 to 1 s.
    """

    name: str = "none"
    """Name of the filter, a key of `FILTERS`."""
    time: float = 0.05
    """Time of the filter, s."""

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
