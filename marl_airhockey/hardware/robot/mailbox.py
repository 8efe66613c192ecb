"""Mailbox: memory that a robot's driver shares with its caller.

Nobody waits for a lock, see `block.Block`.
"""

from __future__ import annotations

import ctypes
import multiprocessing
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple, Self

import numpy as np

from marl_airhockey.hardware.block import Block
from marl_airhockey.hardware.robot.arm import ArmFault
from marl_airhockey.types import Array

JOINT_NAMES = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
"""Names of the joints, in their order"""
TRACK = 128
"""Number of positions of the paddle that are kept"""
LOG = 32
"""Number of changes of the state that are kept"""


class DriverState(IntEnum):
    """State of a robot's driver, see `supervisor`."""

    STARTING = 0
    READY = 1
    RUNNING = 2
    HOLD = 3
    FAULT = 4
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
    NOT_AT_TABLE = 9
    DEVIATION = 10
    CONNECTION_LOST = ArmFault.CONNECTION_LOST
    PADDLE_BELOW_TABLE = 12
    PADDLE_OFF_TABLE = 13

    @property
    def label(self) -> str:
        """Name for messages."""
        return self.name.lower().replace("_", " ")


class RobotObservation(NamedTuple):
    """Observation of a driver and its arm, table frame, m, m/s and s."""

    state: int
    """`DriverState`"""
    fault: int
    """`Fault`: reason of the state"""
    stamp: float
    """Time of this observation, of the monotonic clock"""
    robot_time: float
    """Time of the reading, of the robot's clock"""
    x: float
    y: float
    z: float
    """Height of the paddle above the table's plane"""
    vx: float
    vy: float
    sent_x: float
    """Position that the arm was sent to last"""
    sent_y: float
    sent_vx: float
    sent_vy: float
    force: float
    """Force of the table on the paddle, along the table's normal, N"""
    base: float
    """Angle of the first joint, rad; those of the others follow"""
    shoulder: float
    elbow: float
    wrist_1: float
    wrist_2: float
    wrist_3: float
    misalignment: float
    """Angle between the tool and its orientation on the table, rad"""
    speed_scaling: float
    """Fraction of the speed limit that the speed slider leaves"""
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

    @classmethod
    def of_fault(cls, fault: Fault) -> Self:
        """Return the observation of a driver that has no arm, all else 0."""
        blank = [0.0] * len(cls._fields)
        blank[:2] = float(DriverState.FAULT), float(fault)
        return cls._make(blank)


class StateChange(NamedTuple):
    """Change of a driver's state."""

    time: float
    """Time of the monotonic clock, s"""
    state: DriverState
    fault: Fault
    """Reason"""


class Request(NamedTuple):
    """Request of a caller to the driver."""

    vx: float
    vy: float
    seconds: float
    """Time in which the velocity is to be reached, and after which it continues"""
    stamp: float
    """Time of the command, of the monotonic clock"""
    enabled: float
    """1 while somebody holds the driver enabled"""
    recover: float
    """Number of recoveries that an operator has requested"""
    closing: float
    """1 when the driver is to end"""


class Mailbox:
    """Mailbox between a driver and its caller.

    Args:
        memory: Shared array, see `allocate`.
    """

    def __init__(self, memory: Any) -> None:
        numbers = np.frombuffer(memory, np.float64)
        ends = np.cumsum([size + 1 for size in _SIZES])
        parts = np.split(numbers, ends[:-1])
        self._request, self._observation, self._track, self._log = map(Block, parts)

    @staticmethod
    def allocate() -> Any:
        """Return the memory of a mailbox, which processes can inherit."""
        context = multiprocessing.get_context("spawn")
        total = sum(_SIZES) + len(_SIZES)
        return context.Array(ctypes.c_double, total, lock=False)

    @property
    def request(self) -> Request:
        """Newest request of the caller."""
        return Request(*(float(x) for x in self._request.read()))

    @request.setter
    def request(self, request: Request) -> None:
        self._request.write(tuple(request))

    @property
    def observation(self) -> RobotObservation:
        """Newest observation of the driver."""
        return RobotObservation(*self._observation.read().tolist())

    @observation.setter
    def observation(self, observation: RobotObservation) -> None:
        self._observation.write(tuple(observation))

    @property
    def track(self) -> Array:
        """(TRACK, 3) time, s, x and y, m, of the paddle, the newest last."""
        return self._track.read().reshape(TRACK, 3)

    @track.setter
    def track(self, track: Array) -> None:
        self._track.write(track.ravel())

    @property
    def transitions(self) -> list[StateChange]:
        """Last changes of the state, the newest last."""
        rows = self._log.read().reshape(LOG, 3)
        rows = rows[rows[:, 0] > 0.0]
        return [
            StateChange(time, DriverState(int(state)), Fault(int(fault)))
            for time, state, fault in rows.tolist()
        ]

    @transitions.setter
    def transitions(self, rows: Sequence[StateChange]) -> None:
        last = np.zeros((LOG, 3))
        newest = rows[-LOG:]
        last[LOG - len(newest) :] = newest
        self._log.write(last.ravel())


_SIZES = (len(Request._fields), len(RobotObservation._fields), 3 * TRACK, 3 * LOG)
"""Numbers in each part of a mailbox"""
