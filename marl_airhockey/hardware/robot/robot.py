"""Robot: interface of a paddle that an arm moves."""

from __future__ import annotations

import math
import multiprocessing
import threading
import time
from collections.abc import Mapping
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import ClassVar, Self

import numpy as np

from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.hardware.robot.driver import NEW_PROCESS
from marl_airhockey.hardware.robot.mailbox import (
    DriverState,
    Fault,
    Mailbox,
    Request,
    RobotObservation,
    StateChange,
)
from marl_airhockey.hardware.robot.process import run_driver
from marl_airhockey.hardware.robot.start import (
    EMERGENCY,
    RobotError,
    check_arm,
    start_failure,
)
from marl_airhockey.types import Array

START = 30.0
"""Longest time until the robot client has connected, s."""
RECOVERY = 3.0
"""Longest time of a recovery, s."""
SILENT = 0.3
"""Time without an observation after which the robot client counts as ended, s."""
SLOW = 0.25
"""Speed at which a paddle is moved to a position, m/s."""
NEAR = 0.004
"""Distance from a position below which the paddle counts as arrived, m."""


class Robot:
    """Robot with a robot client in a separate process.

    Its methods are those of a LeRobot device: `connect`, `get_observation`,
    `send_action` and `disconnect`, or a ``with`` block. In addition, it moves only
    while it is enabled, and brakes when commands do not arrive.

    Args:
        config: Configuration of the robot.
    """

    observation_features: ClassVar[Mapping[str, type]] = dict.fromkeys(
        RobotObservation._fields, float
    )
    """Names and types of the fields of an observation."""
    action_features: ClassVar[Mapping[str, type]] = {"vx": float, "vy": float}
    """Names and types of an action: a velocity, table frame, m/s."""

    def __init__(self, config: RobotConfig) -> None:
        self.config = config
        self._box: Mailbox | None = None
        self._process: SpawnProcess | None = None
        self._enabled, self._recoveries = 0.0, 0.0
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.disconnect()

    def connect(self) -> None:
        """Start the robot client and wait until the arm responds; nothing moves.

        With an arm in a protective stop, the state is then FAULT. `recover` leaves it.

        Raises:
            RobotError: No arm responds, its controller cannot be used, a joint would
                reach its limits in the workspace, the arm is not at the table, or it is
                in an emergency stop.
        """
        check_arm(self.config)
        memory = Mailbox.allocate()
        self._box, self._enabled, self._recoveries = Mailbox(memory), 0.0, 0.0
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
        observation = self.get_observation()
        if self.state is DriverState.READY or self.fault is Fault.PROTECTIVE_STOP:
            return
        self.disconnect()
        raise RobotError(start_failure(self.config.host, observation))

    @property
    def _mailbox(self) -> Mailbox:
        if self._box is None:
            raise RobotError("robot: connect() first")
        return self._box

    @property
    def pid(self) -> int | None:
        """ID of the robot client's process."""
        return self._process.pid if self._process else None

    def get_observation(self) -> RobotObservation:
        """Return the newest observation of robot client and arm, table frame."""
        return self._mailbox.observation

    @property
    def state(self) -> DriverState:
        """State of the robot client."""
        return DriverState(int(self.get_observation().state))

    @property
    def fault(self) -> Fault:
        """Reason of a HOLD or a FAULT."""
        return Fault(int(self.get_observation().fault))

    @property
    def transitions(self) -> list[StateChange]:
        """Last changes of the state with their reasons, the newest last."""
        return self._mailbox.transitions

    @property
    def commanded_at(self) -> float:
        """Time of the last command, monotonic clock, s."""
        return self._mailbox.request.stamp

    @property
    def is_connected(self) -> bool:
        """True while the robot client runs and sends observations."""
        running = self._process is not None and self._process.is_alive()
        return running and time.monotonic() - self.get_observation().stamp < SILENT

    @property
    def track(self) -> Array:
        """Time, s, and x and y, m, of the paddle (n, 3), the newest last."""
        return self._mailbox.track

    def enable(self) -> None:
        """Accept commands from now on.

        The person who holds the enabling device calls it.
        """
        with self._lock:
            self._enabled = 1.0
            self._request(np.zeros(2), 0.0)

    def disable(self) -> None:
        """Brake and accept no commands, including those of other threads."""
        with self._lock:
            self._enabled = 0.0
            self._request(np.zeros(2), 0.0)

    def send_action(self, velocity: Array, seconds: float) -> Array:
        """Command a velocity.

        The command is valid until the next one, and no longer than 0.15 s.

        Args:
            velocity: Target velocity (2,), table frame, m/s.
            seconds: Time of a linear ramp to the velocity, s.

        Returns:
            Velocity (2,) that was sent to the robot client, m/s. It is clipped to the
            speed limit. It is zero if the given velocity is not finite or the robot is
            not enabled. The next observation contains the velocity that was sent to the
            arm.

        Raises:
            ValueError: The velocity has another shape.
        """
        velocity = np.asarray(velocity, float)
        if velocity.shape != (2,):
            raise ValueError(f"velocity: shape {velocity.shape}; expected (2,), m/s")
        with self._lock:
            self._request(velocity, seconds)
            enabled = self._enabled
        speed = math.hypot(*velocity)
        if not (math.isfinite(speed) and math.isfinite(seconds) and enabled):
            return np.zeros(2)
        fit = min(1.0, self.config.limits.speed / max(speed, 1e-12))
        return velocity * fit

    def _request(self, velocity: Array, seconds: float) -> None:
        self._mailbox.request = Request(
            *(float(velocity[0]), float(velocity[1]), float(seconds)),
            *(time.monotonic(), self._enabled, self._recoveries, 0.0),
        )

    def go_to(self, position: Array, seconds: float = 10.0) -> None:
        """Move the paddle slowly to a position (2,), table frame, m, and rest there.

        Raises:
            RobotError: The paddle does not arrive in time. The message contains the
                reason.
        """
        until = time.monotonic() + seconds
        self.enable()
        while time.monotonic() < until:
            now = self.get_observation()
            way = np.asarray(position) - (now.x, now.y)
            left = float(np.linalg.norm(way))
            if left < NEAR and np.hypot(now.vx, now.vy) < 0.01:
                self.send_action(np.zeros(2), 0.0)
                return
            self.send_action(way * min(SLOW / max(left, 1e-9), 3.0), 0.02)
            if self.state is DriverState.FAULT:
                raise RobotError(f"robot: {self.fault.label}")
            time.sleep(0.02)
        self.disable()
        raise RobotError(
            f"robot: the paddle did not reach {np.round(position, 3)} m within "
            f"{seconds:.0f} s; {self.state.name}: {self.fault.label}"
        )

    def recover(self) -> None:
        """Continue after a protective stop, with the confirmation of an operator.

        Raises:
            RobotError: The robot is in an emergency stop, which a person releases at
                the pendant before the robot client is started again; or the stop was
                less than 5 s ago.
        """
        if self.fault is Fault.EMERGENCY_STOP:
            raise RobotError(EMERGENCY)
        if self.fault in NEW_PROCESS or not self.is_connected:
            self.disconnect()
            self.connect()
            return
        with self._lock:
            self._recoveries += 1
        self.disable()
        until = time.monotonic() + RECOVERY
        while time.monotonic() < until:
            if self.state is not DriverState.FAULT:
                return
            time.sleep(0.01)
        raise RobotError(
            f"robot: {self.fault.label} is not released; look at the arm, and wait at "
            "least 5 s after a protective stop"
        )

    def disconnect(self) -> None:
        """Brake, disconnect and end the robot client."""
        if self._process is None:
            return
        if self._box is not None and self._process.is_alive():
            self._box.request = Request(
                0.0, 0.0, 0.0, time.monotonic(), 0.0, self._recoveries, 1.0
            )
        self._process.join(3.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process = None
