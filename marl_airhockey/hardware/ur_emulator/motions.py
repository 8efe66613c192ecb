"""Motions of a simulated arm, as the commands of a control script start them."""

from __future__ import annotations

from dataclasses import dataclass

from marl_airhockey.types import Array

STOP_DECELERATION = 20.0
"""Deceleration of the fastest joint in a protective or emergency stop, rad/s2"""


@dataclass
class Servo:
    """Motion toward joint angles, as `servoL` and `servoJ` command it."""

    angles: Array
    """(6,) target, rad"""
    half_rise: float
    """Time to 50 % of a step, s"""


@dataclass
class Speed:
    """Tool velocity without an end, as `speedL` commands it."""

    twist: Array
    """(6,) m/s and rad/s"""
    acceleration: float
    """m/s2"""


@dataclass
class JointSpeed:
    """Joint velocity without an end, as `speedJ` commands it."""

    speeds: Array
    """(6,) rad/s"""
    acceleration: float
    """rad/s2"""


@dataclass
class Line:
    """Straight line to a pose, as `moveL` commands it."""

    pose: Array
    """(6,)"""
    speed: float
    """m/s"""
    acceleration: float
    """m/s2"""


@dataclass
class JointLine:
    """Straight line in joint space, as `moveJ` commands it."""

    angles: Array
    """(6,) target, rad"""
    speed: float
    """Speed of the joint with the longest path, rad/s"""
    acceleration: float
    """rad/s2"""


@dataclass
class Halt:
    """Braking to rest."""

    deceleration: float = STOP_DECELERATION
    """Acceleration of the fastest joint, rad/s2"""


Motion = Servo | Speed | JointSpeed | Line | JointLine | Halt


@dataclass
class Force:
    """Compliance along the z axis of a frame."""

    frame: Array
    """(6,) pose, base frame"""
    newtons: float
    """Force along that axis which the arm exerts; below 0 it presses down"""
    speed: float
    """Largest speed along it, m/s"""
