"""Motion of a paddle: positions and heights that are sent to an arm."""

from __future__ import annotations

import math

import numpy as np

from marl_airhockey.hardware.robot.arm import Reading
from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.hardware.robot.shaper import Shaper
from marl_airhockey.types import Array

MARGIN = 0.001
"""Least distance of sent positions from the edge of the workspace, m; the lag of the
joints bends a path by less."""
AT_REST = 0.01
"""Speed of the paddle in the table's plane below which it rests, m/s."""
LEAST_GAP = 0.001
"""Gap between the sent and the measured position that is allowed at any speed, m."""
NO_LEAP = 0.085
"""Largest gap between the sent and the measured position, as the time in which the
paddle covers it at its speed limit, s. The emulated arm closes a gap of 0.087 s, to a
position at rest, at that limit. From a larger gap it would leap."""
SLOWEST = 0.1
"""Fraction of the speed limit that is used for an arm that is too late."""
SCALING_RISE = 2.0
"""Largest rise per second of the fraction of the speed limit that is used, after the
speed slider was low."""


class Motion:
    """Motion of one paddle, table frame.

    Args:
        config: Configuration of the robot.
        dt: Time of a cycle, s.
        position: Present position (3,) of the paddle, m.
    """

    def __init__(self, config: RobotConfig, dt: float, position: Array) -> None:
        self._config, self._dt = config, dt
        self._filter = config.smoothing.make(dt)
        self.most = max(NO_LEAP * config.limits.speed, LEAST_GAP)
        """Largest gap between the sent and the measured position, m."""
        self.latest = max(config.servo.deviation * config.limits.speed, LEAST_GAP)
        """Largest distance of the arm from its expected position, m."""
        self._follows = 1.0
        self.scaling = 1.0
        """Fraction of the speed limit that is used."""
        self.stay(position)

    def stay(self, position: Array) -> None:
        """Restart at rest at a position (3,), m."""
        self._usual = np.array(position[:2], float)
        self.height = float(position[2])
        """Height of the sent position, m; a compliant arm does not follow it."""
        self._stamp, self._ahead, self._late = math.nan, np.zeros(2), 0.0
        self._known = np.array(position[:2], float)
        self._rest_at(np.array(position[:2], float))
        self._settled = True

    def _rest_at(self, place: Array) -> None:
        config = self._config
        self._filter.reset(np.zeros(2))
        reach = np.array(config.reach)
        self.shaper = Shaper(config.limits, reach, self._dt, place, MARGIN)

    @property
    def pose(self) -> Array:
        """Pose (6,) of the sent position, base frame, m and rad."""
        return self._config.mounting.pose(self.shaper.place, self.height)

    def measure(self, stamp: float, position: Array) -> float:
        """Return the distance of the arm from its expected position, m.

        Args:
            stamp: Time of the measurement, robot's clock, s.
            position: Measured position (3,) of the paddle, m.
        """
        self._known = np.array(position[:2], float)
        if stamp != self._stamp:
            # With an old reading, the reading is behind the arm, not the arm behind its
            # target.
            self._stamp, self._ahead = stamp, self.shaper.place - position[:2]
            self._late = float(np.linalg.norm(self._usual - position[:2]))
        return self._late

    def scale_speed(self, fraction: float) -> None:
        """Limit the speed to the fraction that the speed slider allows.

        An arm that moves more slowly than the sent poses would leap when the slider is
        turned up again.
        """
        fraction = min(max(fraction, 0.0), 1.0) if math.isfinite(fraction) else 0.0
        self._follows = fraction
        # An arm with more lag than usual would also leap when the lag becomes normal.
        late = self._late / self.latest
        fraction = min(fraction, max(2.0 * (1.0 - late), SLOWEST))
        self.scaling = min(fraction, self.scaling + SCALING_RISE * self._dt)
        self.shaper.scale_speed(self.scaling)

    def step(self, velocity: Array, left: float) -> None:
        """Move by one cycle toward a velocity.

        Args:
            velocity: Commanded velocity (2,), m/s, finite.
            left: Time until the velocity has to be reached, s.
        """
        self._settled = False
        self._expect()
        if self._wait_for_arm():
            return
        # A filter may overflow on a number that is finite.
        size = max(math.hypot(*velocity), 1e-12)
        fitted = velocity * min(1.0, self._config.limits.speed / size)
        self.shaper.step(*self._filter.step(fitted, left))

    def brake(self) -> None:
        """Move by one cycle toward rest."""
        self._expect()
        if not self._wait_for_arm():
            self.shaper.brake()
            self._filter.reset(self.shaper.velocity)

    def _expect(self) -> None:
        """Update the expected position of the arm, which the speed slider slows."""
        share = -math.expm1(-self._follows * self._dt / self._config.servo.lag)
        self._usual += share * (self.shaper.place - self._usual)

    def _wait_for_arm(self) -> bool:
        """Stop and return True if the arm may be too far away to follow without a leap.

        An arm without new readings may have stopped at its last known position.
        """
        place = self.shaper.place
        too_far = float(np.linalg.norm(place - self._known)) > self.most
        if too_far:
            self._rest_at(place)
        return too_far

    def come_to_rest(self, reading: Reading, position: Array) -> None:
        """Move by one cycle toward rest at the position of the arm.

        Args:
            reading: Newest reading of the arm.
            position: Measured position (3,) of the paddle, m.
        """
        late, place = self.measure(reading.stamp, position), np.array(position[:2])
        gap = float(np.linalg.norm(self._ahead))
        if gap > self.most or (late > self.latest and not self.shaper.at_rest):
            # The arm would leap to the sent position as soon as it can move.
            self._rest_at(place + self._ahead * min(self.most / gap, 1.0))
        self.brake()
        velocity = self._config.mounting.rotate_to_table(reading.velocity)[:2]
        rests = self.shaper.at_rest and np.linalg.norm(velocity) < AT_REST
        if rests and not self._settled:
            self._settled = True
            if gap > LEAST_GAP:
                self._rest_at(place)
