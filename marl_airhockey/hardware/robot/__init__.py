"""Robots: what moves a paddle on a real table, and the limits before it.

A `Robot` runs a driver in a process of its own, which sends an `Arm` a new pose 125
times a second. It takes commanded velocities; whatever they are, what it sends stays
within limits of speed, acceleration, jerk and reach, and comes to rest when commands
fail to come.
"""

from marl_airhockey.hardware.robot.arm import Arm, ArmFault, Reading
from marl_airhockey.hardware.robot.config import (
    PRESETS,
    Pendant,
    Preset,
    RobotConfig,
    ServoSettings,
)
from marl_airhockey.hardware.robot.filters import FILTERS, Smoothing
from marl_airhockey.hardware.robot.mailbox import (
    DriverState,
    Fault,
    RobotObservation,
    StateChange,
)
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.hardware.robot.robot import Robot
from marl_airhockey.hardware.robot.shaper import MotionLimits, Shaper
from marl_airhockey.hardware.robot.start import RobotError

__all__ = [
    "FILTERS",
    "PRESETS",
    "Arm",
    "ArmFault",
    "DriverState",
    "Fault",
    "MotionLimits",
    "Mounting",
    "Pendant",
    "Preset",
    "Reading",
    "Robot",
    "RobotConfig",
    "RobotError",
    "RobotObservation",
    "ServoSettings",
    "Shaper",
    "Smoothing",
    "StateChange",
]
