"""Mailbox: memory that a robot's driver shares with whoever commands it.

Nobody waits for a lock, see `block.Block`.
"""

from __future__ import annotations

import ctypes
import multiprocessing
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.devices.block import Block
from marl_airhockey.devices.robot.arm import ArmFault
from marl_airhockey.types import Array

JOINT_NAMES = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
"""Names of the joints, in their order"""
TRACK = 128
"""Number of places of the paddle that are kept"""


class DriverState(IntEnum):
    """State of a robot's driver."""

    STARTING = 0
    READY = 1
    """At rest; commands are not taken until it is enabled"""
    RUNNING = 2
    HOLD = 3
    """Enabled, and braked or braking, because something is missing"""
    FAULT = 4
    """The arm does not follow; somebody has to look"""
    CLOSED = 5


class Fault(IntEnum):
    """Reason of a HOLD or a FAULT."""

    NONE = ArmFault.NONE
    PROTECTIVE_STOP = ArmFault.PROTECTIVE_STOP
    EMERGENCY_STOP = ArmFault.EMERGENCY_STOP
    PROGRAM_LOST = ArmFault.PROGRAM_LOST
    ROBOT_SILENT = 4
    COMMAND_STALE = 5
    PADDLE_LIFTED = 6
    DRIVER_LATE = 7
    NOT_CONNECTED = 8

    @property
    def words(self) -> str:
        """Reason in words."""
        return self.name.lower().replace("_", " ")


class Status(NamedTuple):
    """State of a driver and its arm, table frame, m, m/s and s."""

    state: int
    fault: int
    stamp: float
    """Time of this status, of the monotonic clock"""
    x: float
    y: float
    z: float
    """Height of the paddle above the table's plane"""
    vx: float
    vy: float
    sent_x: float
    """Place that the arm was sent to last"""
    sent_y: float
    sent_vx: float
    sent_vy: float
    force: float
    """Force on the tool along the base's z, N"""
    base: float
    shoulder: float
    elbow: float
    wrist_1: float
    wrist_2: float
    wrist_3: float
    """Angle of the last joint, rad, as those of the others above"""
    cycles: int
    """Number of cycles of the driver"""
    late: int
    """Number of those that began more than half a period late"""
    refused: int
    """Number of commands that were not finite"""
    braked_at: float
    """Time at which braking began last, of the monotonic clock"""

    @property
    def joints(self) -> tuple[float, ...]:
        """Angles of the six joints, rad."""
        return tuple(getattr(self, name) for name in JOINT_NAMES)


class Wanted(NamedTuple):
    """What the driver is asked for."""

    vx: float
    vy: float
    seconds: float
    """Time in which the velocity is to be reached, and after which it goes on"""
    stamp: float
    """Time of the command, of the monotonic clock"""
    enabled: float
    """1 while somebody holds the driver enabled"""
    recover: float
    """Number of recoveries that an operator has asked for"""
    closing: float
    """1 when the driver is to end"""


class Mailbox:
    """Mailbox between a driver and who commands it.

    Args:
        memory: shared array, see `allocate`.
    """

    def __init__(self, memory: Any) -> None:
        numbers = np.frombuffer(memory, np.float64)
        first = 1 + len(Wanted._fields)
        second = first + 1 + len(Status._fields)
        self._wanted = Block(numbers[:first])
        self._status = Block(numbers[first:second])
        self._track = Block(numbers[second:])

    @staticmethod
    def allocate() -> Any:
        """Return the memory of a mailbox, which processes can inherit."""
        sizes = len(Wanted._fields), len(Status._fields), 3 * TRACK
        context = multiprocessing.get_context("spawn")
        return context.Array(ctypes.c_double, sum(sizes) + len(sizes), lock=False)

    @property
    def wanted(self) -> Wanted:
        """What is asked for."""
        return Wanted(*(float(x) for x in self._wanted.read()))

    @wanted.setter
    def wanted(self, wanted: Wanted) -> None:
        self._wanted.write(tuple(wanted))

    @property
    def status(self) -> Status:
        """State of the driver."""
        return Status(*self._status.read().tolist())

    @status.setter
    def status(self, status: Status) -> None:
        self._status.write(tuple(status))

    @property
    def track(self) -> Array:
        """(TRACK, 3) time, s, x and y, m, of the paddle, the newest last."""
        return self._track.read().reshape(TRACK, 3)

    @track.setter
    def track(self, track: Array) -> None:
        self._track.write(track.ravel())
