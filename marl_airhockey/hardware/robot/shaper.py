"""Shaper: last filter before an arm, applied to each commanded position.

It converts arbitrary target velocities into positions that an arm can follow, within
limits of speed, acceleration and jerk, and inside the workspace. It continues from its
last output, not from the measured position of the arm.

The limits hold for any target, because after every step the paddle can still brake to
rest within the limits of speed and workspace. A step that would violate this is mixed
with the braking step. The braking step is always safe, as it begins the braking that
was checked one step before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.sim.core.geometry import half_planes
from marl_airhockey.types import Array

HALVINGS = 4
"""Number of bisection steps in the search for a mixture with braking."""
LONGEST = 250
"""Largest number of steps until rest."""
AT_REST = 1e-9
"""Speed, m/s, and acceleration, m/s2, below which braking is over."""


@dataclass(frozen=True)
class MotionLimits:
    """Limits of a paddle's motion.

    Raises:
        ValueError: A limit is not a finite number in its range.
    """

    speed: float = 0.7
    """Top speed, m/s."""
    acceleration: float = 7.0
    """Largest acceleration, m/s2."""
    jerk: float = 280.0
    """Largest jerk, m/s3; it reverses the acceleration in a step of 50 ms."""

    def __post_init__(self) -> None:
        check_fields(self, speed=(1e-3, 10), acceleration=(0.01, 1e3), jerk=(0.1, 1e7))

    @property
    def stopping_distance(self) -> float:
        """Distance from top speed to rest, m."""
        lead = self.acceleration / (2.0 * self.jerk)
        return self.speed * (self.speed / (2.0 * self.acceleration) + lead)


class Shaper:
    """Shaper of one paddle's motion, table frame.

    Args:
        limits: Limits of the motion.
        reach: Workspace, a convex polygon (K, 2) of the paddle's centre,
            counter-clockwise, m.
        dt: Time between two steps, s.
        place: Position (2,) of the resting paddle, m.
        margin: Least distance from the edge of the workspace, m.
    """

    def __init__(
        self,
        limits: MotionLimits,
        reach: Array,
        dt: float,
        place: Array,
        margin: float = 0.0,
    ) -> None:
        self._limits, self._dt = limits, dt
        self._speed = limits.speed
        corners = tuple((float(x), float(y)) for x, y in reach)
        normals, offsets = half_planes(corners)
        self._offsets = offsets - margin
        self._normals = normals[:, 0] + 1j * normals[:, 1]
        # Adjacent edges share the acceleration for braking, as in the world's limits.
        meet = (normals * np.roll(normals, -1, 0)).sum(-1).min()
        self._braking = limits.acceleration * np.sqrt((1.0 + meet) / 2.0)
        # Vectors are complex numbers, which are 100 times as fast as arrays of two.
        self._place, self._velocity = complex(*place), 0j
        self._acceleration = 0j
        # A paddle that begins outside may move in, but not further out.
        outside = -((self._normals.conj() * self._place).real + self._offsets)
        self._widened = self._offsets + np.maximum(outside, 0.0)

    @property
    def place(self) -> Array:
        """Last commanded position (2,), m."""
        return _array(self._place)

    @property
    def velocity(self) -> Array:
        """Velocity (2,) at the last commanded position, m/s."""
        return _array(self._velocity)

    @property
    def acceleration(self) -> Array:
        """Acceleration (2,) of the last step, m/s2."""
        return _array(self._acceleration)

    @property
    def at_rest(self) -> bool:
        """True if the last commanded position does not move."""
        return abs(self._velocity) < AT_REST

    def scale_speed(self, fraction: float) -> None:
        """Limit the speed to a fraction, 0 to 1, of the limit."""
        self._speed = fraction * self._limits.speed

    def step(self, velocity: Array, seconds: float) -> Array:
        """Move by ``dt`` and return the new position (2,), m.

        Args:
            velocity: Target velocity (2,), m/s. A value that is not finite means rest.
            seconds: Time of a linear ramp to the velocity, s; 0 for as fast as
                possible.
        """
        target = self._inside(_fitted(complex(*velocity), self._speed))
        moved = self._velocity, self._acceleration
        return self._advance(self._recoverable(self._toward(target, seconds, *moved)))

    def brake(self) -> Array:
        """Move by ``dt`` toward rest and return the new position (2,), m."""
        return self._advance(self._toward(0j, 0.0, self._velocity, self._acceleration))

    def _advance(self, acceleration: complex) -> Array:
        last, self._acceleration = self._velocity, acceleration
        self._velocity += acceleration * self._dt
        self._place += 0.5 * (last + self._velocity) * self._dt
        return self.place

    def _toward(
        self, target: complex, seconds: float, velocity: complex, acceleration: complex
    ) -> complex:
        """Return the next acceleration toward a target velocity."""
        limits, dt = self._limits, self._dt
        change = target - velocity
        size, pull = abs(change), 0j
        if size > 0.0:
            # Near the target, the jerk limits the acceleration.
            most = min(
                limits.acceleration,
                size / max(seconds, dt),
                math.sqrt(limits.jerk * size),
            )
            pull = change * (most / size)
        jerk = _fitted(pull - acceleration, limits.jerk * dt)
        return _fitted(acceleration + jerk, limits.acceleration)

    def _recoverable(self, wish: complex) -> complex:
        """Return ``wish``, mixed with as much braking as the limits require."""
        if self._can_brake(wish):
            return wish
        braking = best = self._toward(0j, 0.0, self._velocity, self._acceleration)
        share = 0.5
        for k in range(HALVINGS):
            tried = braking + share * (wish - braking)
            fits = self._can_brake(tried)
            best = tried if fits else best
            share += 0.25 * 0.5**k * (1 if fits else -1)
        return best

    def _can_brake(self, acceleration: complex) -> bool:
        """Return True if a step, then braking, stay within speed and workspace."""
        place, velocity, dt = self._place, self._velocity, self._dt
        way = []
        for _ in range(LONGEST):
            last, velocity = velocity, velocity + acceleration * dt
            if abs(velocity) > self._speed:
                return False
            place += 0.5 * (last + velocity) * dt
            way.append(place)
            if abs(velocity) < AT_REST and abs(acceleration) < AT_REST:
                room = np.multiply.outer(way, self._normals.conj()).real
                return bool((room + self._widened).min() >= 0.0)
            acceleration = self._toward(0j, 0.0, velocity, acceleration)
        return False

    def _inside(self, velocity: complex) -> complex:
        """Return a velocity from which the paddle can stop before every edge."""
        limits = self._limits
        room = (self._normals.conj() * self._place).real + self._offsets
        # Stopping distance from v: v^2 / 2a, and v times the delay of full braking.
        late = limits.acceleration / limits.jerk + 2.0 * self._dt
        root = np.sqrt(late**2 + 2.0 * np.maximum(room, 0.0) / self._braking)
        fastest = self._braking * (root - late)
        for _ in range(8):
            over = -(self._normals.conj() * velocity).real - fastest
            worst = int(np.argmax(over))
            if over[worst] <= 1e-12:
                break
            velocity += float(over[worst]) * complex(self._normals[worst])
        return velocity


def _fitted(vector: complex, most: float) -> complex:
    """Return a vector no longer than ``most``; 0 for one that is not finite."""
    size = abs(vector)
    if not math.isfinite(size):
        return 0j
    return vector * (most / size) if size > most else vector


def _array(vector: complex) -> Array:
    return np.array([vector.real, vector.imag])
