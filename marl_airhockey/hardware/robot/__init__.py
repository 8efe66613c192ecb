"""Robot client of a real table, with limits on the motion of the paddle.

A `Robot` runs the robot client in a separate process, which sends a new pose to an
`Arm` 125 times a second. It accepts any commanded velocity. The motion that it sends
stays within limits of speed, acceleration, jerk and workspace, and comes to rest when
commands do not arrive.
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
