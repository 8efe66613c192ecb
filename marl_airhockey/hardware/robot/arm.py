"""Arm: the contract between the driver and the network of a robot."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, Protocol

from marl_airhockey.types import Array


class ArmFault(IntEnum):
    """Reason for which an arm does not follow, as it reports itself."""

    NONE = 0
    PROTECTIVE_STOP = 1
    EMERGENCY_STOP = 2
    PROGRAM_LOST = 3
    CONNECTION_LOST = 11


class Reading(NamedTuple):
    """Newest reading of an arm, base frame."""

    stamp: float
    """Time of the robot's clock, s; one that stands still is a robot that is silent"""
    pose: Array
    """(6,) of the tool's centre: m and rotation vector"""
    velocity: Array
    """(6,) m/s and rad/s"""
    force: Array
    """(6,) N and Nm"""
    joints: Array
    """(6,) angles, rad, from the base to the last wrist"""
    fault: ArmFault
    speed_scaling: float
    """Fraction of every programmed speed that the arm moves with: the speed slider"""


class Arm(Protocol):
    """Arm that follows poses of its tool; all calls return within milliseconds.

    `Ur5e` is one; an arm of another maker needs a class like it.
    """

    def read(self) -> Reading:
        """Return the newest reading."""

    def zero_force_sensor(self) -> None:
        """Take the present force as zero; the tool must touch nothing."""

    def press(self, frame: Array, newtons: float) -> None:
        """Become compliant along the z axis of a frame (6,) and press down."""

    def follow(self, pose: Array, seconds: float) -> bool:
        """Follow a pose (6,) until the next one ``seconds`` later; False if refused."""

    def release(self, pose: Array) -> None:
        """End compliance and hold a pose (6,)."""

    def halt(self) -> None:
        """Brake to rest and end compliance."""

    def unlock(self) -> str:
        """Release a protective stop; return "" or why that is refused."""

    def close(self) -> None:
        """Halt, if it still obeys, and disconnect."""
