"""Poses of a client's `servoL`, and faults in the handling of late poses."""

from __future__ import annotations

import numpy as np

from marl_airhockey.hardware.ur_emulator.arm import DT, JOINT_SPEED
from marl_airhockey.types import Array

PERIOD = 0.008
"""Time between two poses of a client, s."""
LATE, EXTRAPOLATED = 0.01, 0.2
"""Times after the last command between which poses are extrapolated, s."""


class Poses:
    """Poses that a client sends one after the other."""

    def __init__(self) -> None:
        self.extrapolates = False
        """True if a pose that arrives late is extrapolated, a fault."""
        self.checks_speed = False
        """True if a pose that requires too fast joints ends the script, a fault."""
        self._newest, self._last = np.zeros(6), np.zeros(6)

    def take(self, pose: Array, silence: float) -> Array:
        """Return the pose (6,) to follow.

        Args:
            pose: Newest pose (6,), base frame, m and rad.
            silence: Time since the newest pose arrived, s.
        """
        if (pose != self._newest).any():
            self._last, self._newest = self._newest, pose
        late = self.extrapolates and LATE < silence < EXTRAPOLATED
        return pose + late * (pose - self._last) * (silence - LATE) / PERIOD

    def too_fast(self, before: Array, after: Array, silence: float) -> bool:
        """Return True if a script that checks speeds rejects new joint angles.

        Args:
            before: Angles (6,) of the last pose, rad.
            after: Angles (6,) of the newest pose, rad.
            silence: Time since the newest pose arrived, s.
        """
        speed = float(np.abs(after - before).max()) / PERIOD
        return self.checks_speed and silence <= DT and speed > JOINT_SPEED
