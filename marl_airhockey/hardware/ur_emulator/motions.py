"""Motions of a simulated arm, as the commands of a control script start them."""

from __future__ import annotations

from dataclasses import dataclass

from marl_airhockey.types import Array

STOP_DECELERATION = 20.0
"""Deceleration of the fastest joint in a protective or emergency stop, rad/s2."""


@dataclass
class Servo:
    """Motion toward joint angles, as `servoL` and `servoJ` command it."""

    angles: Array
    """Target (6,) of the joint angles, rad."""
    half_rise: float
    """Time to 50 % of a step, s."""


@dataclass
class Speed:
    """Constant velocity of the tool, as `speedL` commands it."""

    twist: Array
    """Velocity (6,) of the tool, base frame, m/s and rad/s."""
    acceleration: float
    """Acceleration of the tool, m/s2."""


@dataclass
class JointSpeed:
    """Constant velocity of the joints, as `speedJ` commands it."""

    speeds: Array
    """Velocity (6,) of the joints, rad/s."""
    acceleration: float
    """Acceleration of each joint, rad/s2."""


@dataclass
class Line:
    """Straight line to a pose, as `moveL` commands it."""

    pose: Array
    """Target pose (6,) of the tool, base frame, m and rad."""
    speed: float
    """Speed of the tool, m/s."""
    acceleration: float
    """Acceleration of the tool, m/s2."""


@dataclass
class JointLine:
    """Straight line in joint space, as `moveJ` commands it."""

    angles: Array
    """Target (6,) of the joint angles, rad."""
    speed: float
    """Speed of the joint with the longest path, rad/s."""
    acceleration: float
    """Acceleration of this joint, rad/s2."""


@dataclass
class Halt:
    """Braking to rest."""

    deceleration: float = STOP_DECELERATION
    """Deceleration of the fastest joint, rad/s2."""


Motion = Servo | Speed | JointSpeed | Line | JointLine | Halt


@dataclass
class Force:
    """Compliance along the z axis of a frame."""

    frame: Array
    """Pose (6,) of the frame, base frame, m and rad."""
    newtons: float
    """Force of the arm along that axis, N; below 0 it presses down."""
    speed: float
    """Largest speed along that axis, m/s."""
