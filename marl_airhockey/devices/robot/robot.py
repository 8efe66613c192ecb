"""Robot: a paddle that an arm moves, as the rest of the library commands it."""

from __future__ import annotations

import multiprocessing
import time
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Self

import numpy as np

from marl_airhockey.devices.robot.driver import DriverConfig, run_driver
from marl_airhockey.devices.robot.mailbox import (
    DriverState,
    Fault,
    Mailbox,
    Status,
    Wanted,
)
from marl_airhockey.types import Array

START = 30.0
"""Longest time until a driver has connected, s"""
RECOVERY = 3.0
"""Longest time that a recovery takes, s"""
SLOW = 0.25
"""Speed at which a paddle goes to a place, m/s"""
NEAR = 0.004
"""Distance from a place that is there, m"""
EMERGENCY = "robot: emergency stop; release it at the pendant, then start again"


class RobotError(RuntimeError):
    """Error of a robot that does not do what it was asked for."""


class Robot:
    """Robot whose driver runs in a process of its own.

    It is used in a ``with`` block, which starts the driver and ends it. It moves only
    while it is enabled, and brakes when commands fail to come.

    Args:
        config: of the robot.
    """

    def __init__(self, config: DriverConfig) -> None:
        self.config = config
        self._box: Mailbox | None = None
        self._process: SpawnProcess | None = None
        self._enabled, self._recoveries = 0.0, 0.0

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def connect(self) -> None:
        """Start the driver and wait until the arm answers.

        An arm in a protective stop is then in FAULT, and `recover` is for it.

        Raises:
            RobotError: it does not answer, or is in an emergency stop.
        """
        memory = Mailbox.allocate()
        self._box, self._enabled = Mailbox(memory), 0.0
        context = multiprocessing.get_context("spawn")
        self._process = context.Process(
            target=run_driver, args=(self.config, memory), daemon=True
        )
        self._process.start()
        until = time.monotonic() + START
        while self.state is DriverState.STARTING and time.monotonic() < until:
            if not self._process.is_alive():
                break
            time.sleep(0.01)
        state, fault = self.state, self.fault
        if state is DriverState.READY or fault is Fault.PROTECTIVE_STOP:
            return
        self.close()
        if fault is Fault.EMERGENCY_STOP:
            raise RobotError(EMERGENCY)
        raise RobotError(
            f"robot at {self.config.host}: no arm answers; is it switched on, in "
            "remote control, and in this network?"
        )

    @property
    def _mailbox(self) -> Mailbox:
        if self._box is None:
            raise RobotError("robot: connect() first")
        return self._box

    @property
    def pid(self) -> int | None:
        """Number of the driver's process."""
        return self._process.pid if self._process else None

    @property
    def status(self) -> Status:
        """State of driver and arm."""
        return self._mailbox.status

    @property
    def state(self) -> DriverState:
        """State of the driver."""
        return DriverState(int(self.status.state))

    @property
    def fault(self) -> Fault:
        """Reason of a HOLD or a FAULT."""
        return Fault(int(self.status.fault))

    @property
    def commanded_at(self) -> float:
        """Time of the last command, of the monotonic clock, s."""
        return self._mailbox.wanted.stamp

    @property
    def alive(self) -> bool:
        """True while the driver runs and tells of itself."""
        running = self._process is not None and self._process.is_alive()
        return running and time.monotonic() - self.status.stamp < 2 * 0.15

    @property
    def track(self) -> Array:
        """(n, 3) time, s, x and y, m, of the paddle, the newest last."""
        return self._mailbox.track

    def enable(self) -> None:
        """Take commands from now on; whoever holds the enabling device calls it."""
        self._want(np.zeros(2), 0.0, 1.0)

    def disable(self) -> None:
        """Brake and take no commands."""
        self._want(np.zeros(2), 0.0, 0.0)

    def command(self, velocity: Array, seconds: float) -> None:
        """Ask for a velocity (2,), table frame, m/s, reached in some seconds.

        It holds until the next command, and no longer than 0.15 s.
        """
        self._want(velocity, seconds, self._enabled)

    def _want(self, velocity: Array, seconds: float, enabled: float) -> None:
        self._enabled = enabled
        self._mailbox.wanted = Wanted(
            *(float(velocity[0]), float(velocity[1]), seconds, time.monotonic()),
            *(enabled, self._recoveries, 0.0),
        )

    def go_to(self, place: Array, seconds: float = 10.0) -> None:
        """Move the paddle slowly to a place (2,), table frame, m, and rest there.

        Raises:
            RobotError: it does not arrive in time, with the reason.
        """
        until = time.monotonic() + seconds
        self.enable()
        while time.monotonic() < until:
            status = self.status
            way = np.asarray(place) - (status.x, status.y)
            left = float(np.linalg.norm(way))
            moving = np.hypot(status.vx, status.vy)
            if left < NEAR and moving < 0.01:
                self.command(np.zeros(2), 0.0)
                return
            self.command(way * min(SLOW / max(left, 1e-9), 3.0), 0.02)
            if self.state is DriverState.FAULT:
                raise RobotError(f"robot: {self.fault.words}")
            time.sleep(0.02)
        self.disable()
        raise RobotError(
            f"robot: the paddle did not come to {np.round(place, 3)} m within "
            f"{seconds:.0f} s; {self.state.name}: {self.fault.words}"
        )

    def recover(self) -> None:
        """Go on after a protective stop, on an operator's word.

        Raises:
            RobotError: an emergency stop, which a person releases at the pendant before
                the driver is started again; or the stop was less than 5 s ago.
        """
        if self.fault is Fault.EMERGENCY_STOP:
            raise RobotError(EMERGENCY)
        if self.fault is Fault.ROBOT_SILENT or not self.alive:
            self.close()
            self.connect()
            return
        self._recoveries += 1
        self.disable()
        until = time.monotonic() + RECOVERY
        while time.monotonic() < until:
            if self.state is not DriverState.FAULT:
                return
            time.sleep(0.01)
        raise RobotError(
            f"robot: {self.fault.words} is not released; look at the arm, and wait at "
            "least 5 s after a protective stop"
        )

    def close(self) -> None:
        """Brake, disconnect and end the driver."""
        if self._process is None:
            return
        if self._box is not None and self._process.is_alive():
            self._box.wanted = Wanted(
                0.0, 0.0, 0.0, time.monotonic(), 0.0, self._recoveries, 1.0
            )
        self._process.join(3.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process = None
