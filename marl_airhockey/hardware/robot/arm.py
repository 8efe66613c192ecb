"""Interface between the robot client and an arm driver."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, Protocol

from marl_airhockey.types import Array


class ArmFault(IntEnum):
    """Reason why an arm does not follow, as the arm reports it."""

    NONE = 0
    PROTECTIVE_STOP = 1
    EMERGENCY_STOP = 2
    PROGRAM_LOST = 3
    CONNECTION_LOST = 11


class Reading(NamedTuple):
    """Newest reading of an arm, base frame."""

    stamp: float
    """Time of the robot's clock, s; if it does not advance, the robot is silent."""
    pose: Array
    """Pose (6,) of the tool's centre: position, m, and rotation vector, rad."""
    velocity: Array
    """Velocity (6,) of the tool's centre, m/s and rad/s."""
    force: Array
    """Force and torque (6,) on the tool, N and Nm."""
    joints: Array
    """Joint angles (6,), rad, from the base to the last wrist."""
    fault: ArmFault
    speed_scaling: float
    """Fraction of every programmed speed at which the arm moves (speed slider)."""


class Arm(Protocol):
    """Arm driver that follows poses of the tool.

    All calls return within milliseconds. `Ur5e` is one of them. An arm of another maker
    needs its own class.
    """

    def read(self) -> Reading:
        """Return the newest reading."""

    def zero_force_sensor(self) -> None:
        """Zero the force sensor at the present force; the tool must touch nothing."""

    def press(self, frame: Array, newtons: float) -> None:
        """Become compliant along the z axis of a frame (6,) and press down."""

    def follow(self, pose: Array, seconds: float) -> bool:
        """Follow a pose (6,) until the next one ``seconds`` later.

        Return False if the controller rejects it.
        """

    def release(self, pose: Array) -> None:
        """End compliance and hold a pose (6,)."""

    def halt(self) -> None:
        """Brake to rest and end compliance."""

    def unlock(self) -> str:
        """Release a protective stop; return "", or the reason of a failure."""

    def close(self) -> None:
        """Halt the arm if it still responds, and disconnect."""
