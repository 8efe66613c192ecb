"""Shared memory of the robot client and its caller.

It has no lock, see `block.Block`.
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
"""Names of the joints, from the base to the last wrist."""
TRACK = 128
"""Number of stored positions of the paddle."""
LOG = 32
"""Number of stored changes of the state."""


class DriverState(IntEnum):
    """State of the robot client, see `supervisor`."""

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
        """Name of the fault in messages."""
        return self.name.lower().replace("_", " ")


class RobotObservation(NamedTuple):
    """Observation of the robot client and its arm, table frame, m, m/s and s."""

    state: int
    """Number of the `DriverState`."""
    fault: int
    """Number of the `Fault`, the reason of the state."""
    stamp: float
    """Time of this observation, monotonic clock."""
    robot_time: float
    """Time of the reading of the arm, robot's clock."""
    x: float
    y: float
    z: float
    """Height of the paddle above the table's plane."""
    vx: float
    vy: float
    sent_x: float
    """Last position that was sent to the arm."""
    sent_y: float
    sent_vx: float
    sent_vy: float
    force: float
    """Force of the table on the paddle, along the table's normal, N."""
    base: float
    """Angle of the first joint, rad; the next five fields are those of the others."""
    shoulder: float
    elbow: float
    wrist_1: float
    wrist_2: float
    wrist_3: float
    misalignment: float
    """Angle between the tool and its orientation on the table, rad."""
    speed_scaling: float
    """Fraction of the speed limit that is in use, at most that of the speed slider."""
    cycles: int
    """Number of cycles so far."""
    late: int
    """Number of cycles that began more than half a period late."""
    refused: int
    """Number of commands that were not finite."""
    braked_at: float
    """Time at which braking last began, monotonic clock."""
    applied_at: float
    """Time of the cycle that first executed the newest command, monotonic clock; 0
    before the first."""

    @property
    def joints(self) -> tuple[float, ...]:
        """Angles of the six joints, rad."""
        return tuple(getattr(self, name) for name in JOINT_NAMES)

    @classmethod
    def of_fault(cls, fault: Fault) -> Self:
        """Return the observation of a robot client without an arm; the rest is 0."""
        blank = [0.0] * len(cls._fields)
        blank[:2] = float(DriverState.FAULT), float(fault)
        return cls._make(blank)


class StateChange(NamedTuple):
    """Change of the state of the robot client."""

    time: float
    """Time of the change, monotonic clock, s."""
    state: DriverState
    fault: Fault
    """Reason of the change."""


class Request(NamedTuple):
    """Request of a caller to the robot client."""

    vx: float
    vy: float
    seconds: float
    """Time of a linear ramp to the velocity, s; afterwards it is constant."""
    stamp: float
    """Time of the command, monotonic clock, s."""
    enabled: float
    """1 while the caller enables the robot."""
    recover: float
    """Number of recoveries that an operator has requested."""
    closing: float
    """1 to end the robot client."""


class Mailbox:
    """Shared memory between the robot client and its caller.

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
        """Allocate memory that processes can inherit."""
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
        """Newest observation of the robot client."""
        return RobotObservation(*self._observation.read().tolist())

    @observation.setter
    def observation(self, observation: RobotObservation) -> None:
        self._observation.write(tuple(observation))

    @property
    def track(self) -> Array:
        """Time, s, and x and y, m, of the paddle (TRACK, 3), the newest last."""
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
"""Number of values in each part of the shared memory."""
