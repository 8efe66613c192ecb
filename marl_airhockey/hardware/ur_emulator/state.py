"""State of an arm, which its controller sends to every client ten times a second."""

from __future__ import annotations

import struct

import numpy as np

from marl_airhockey.hardware.robot.kinematics import JOINTS
from marl_airhockey.hardware.robot.limits import (
    BOUNDS,
    CONFIGURATION,
    JOINT,
    JOINT_DATA,
    STATE,
)
from marl_airhockey.hardware.ur_emulator.arm import (
    JOINT_ACCELERATION,
    JOINT_SPEED,
    EmulatedArm,
)

VERSION_MESSAGE = 20
"""Number of the first message, whose contents are not used here."""
FARTHEST = 2 * np.pi
"""Angle that each joint reaches to either side, rad."""


def message(kind: int, body: bytes) -> bytes:
    """Return a message, or a package of one, of some kind."""
    return struct.pack(">iB", len(body) + 5, kind) + body


def state_of(arm: EmulatedArm) -> bytes:
    """Return the message with the joints of an arm and their limits."""
    joints = [
        JOINT.pack(angle, aim, speed, 0.0, 0.0, 0.0, 0.0, 253)
        for angle, aim, speed in zip(arm.angles, arm.target, arm.speeds, strict=True)
    ]
    bounds = [-FARTHEST, FARTHEST] * JOINTS + [JOINT_SPEED, JOINT_ACCELERATION] * JOINTS
    packages = (
        message(JOINT_DATA, b"".join(joints)),
        message(CONFIGURATION, BOUNDS.pack(*bounds)),
    )
    return message(STATE, b"".join(packages))
