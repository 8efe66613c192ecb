"""Warm-up of a robot client before an arm is connected.

The controller ends a control script whose client is silent for 0.1 s. The first calls
of compiled code and the first imports take longer.
"""

from __future__ import annotations

import logging

import numpy as np

from marl_airhockey.hardware.robot.arm import ArmFault, Reading
from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.hardware.robot.driver import RATE, ArmDriver
from marl_airhockey.hardware.robot.mailbox import Mailbox, Request
from marl_airhockey.types import Array

CYCLES = 40
"""Number of cycles of each part."""


class RehearsedArm:
    """Simulated arm that is always at the pose that it was sent.

    Args:
        pose: Initial pose (6,), base frame, m and rad.
    """

    def __init__(self, pose: Array) -> None:
        self.now = 0.0
        """Time, s."""
        self._pose = pose

    def read(self) -> Reading:
        self.now += 1.0 / RATE
        blank = np.zeros(6)
        return Reading(self.now, self._pose, blank, blank, blank, ArmFault.NONE, 1.0)

    def zero_force_sensor(self) -> None:
        """Do nothing."""

    def press(self, frame: Array, newtons: float) -> None:
        """Do nothing."""

    def follow(self, pose: Array, seconds: float) -> bool:
        self._pose = pose
        return True

    def release(self, pose: Array) -> None:
        """Do nothing."""

    def halt(self) -> None:
        """Do nothing."""

    def unlock(self) -> str:
        return ""

    def close(self) -> None:
        """Do nothing."""


def rehearse(config: RobotConfig) -> None:
    """Run a robot client through its states with a simulated arm.

    Args:
        config: Configuration of the robot.
    """
    place, box = np.mean(config.reach, 0), Mailbox(Mailbox.allocate())
    arm = RehearsedArm(config.mounting.pose(place))
    logger = logging.getLogger("marl_airhockey.robot")
    quiet, logger.disabled = logger.disabled, True
    try:
        driver = ArmDriver(config, arm, box, lambda: arm.now)
        for enabled in (0.0, 1.0, 0.0):
            for _ in range(CYCLES):
                velocity = 0.1, 0.1, 0.05
                box.request = Request(*velocity, arm.now, enabled, 0.0, 0.0)
                driver.cycle()
    finally:
        logger.disabled = quiet
