"""Emulated robot: robot client and controller in this process, in emulated time.

The robot client is that of a real arm, and the controller is that of `airhockey
ur-emulator`. `InProcessArm` connects them instead of ur_rtde. Ten minutes of motion
take half a minute, and the same calls give the same motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.robot import (
    DriverState,
    Fault,
    Preset,
    RobotConfig,
    RobotObservation,
    Smoothing,
    StateChange,
)
from marl_airhockey.hardware.robot.driver import RATE, ArmDriver
from marl_airhockey.hardware.robot.mailbox import Mailbox, Request
from marl_airhockey.hardware.ur_emulator.arm import DT
from marl_airhockey.hardware.ur_emulator.controller import Controller
from marl_airhockey.hardware.ur_emulator.faults import FAULTS
from marl_airhockey.hardware.ur_emulator.in_process import InProcessArm
from marl_airhockey.types import Array

EVERY = round(1.0 / RATE / DT)
"""Number of controller periods in a cycle of the robot client."""


class EmulatedRobot:
    """Emulated robot over an empty table.

    Args:
        preset: Limits and settings; None for the defaults.
        smoothing: Filter of the commands; None for no filter.
        setup: Setup of the lab; None for the default.
        away: Additional distance of the arm from the table, m.
    """

    def __init__(
        self,
        preset: Preset | None = None,
        smoothing: Smoothing | None = None,
        setup: LabSetup | None = None,
        away: float = 0.0,
    ) -> None:
        self.setup, preset = setup or LabSetup(), preset or Preset()
        self.config = RobotConfig(
            host="",
            mounting=self.setup.mounting,
            reach=self.setup.seat.reach,
            limits=preset.limits,
            servo=preset.servo,
            pendant=preset.pendant,
            smoothing=smoothing or Smoothing(),
        )
        self.controller = Controller(self.setup.make_arm())
        if away:
            x, y, z = self.setup.mounting.origin
            mounting = replace(self.setup.mounting, origin=(x + away, y, z))
            self.config = replace(self.config, mounting=mounting)
        self.arm = InProcessArm(self.controller, self.config.servo)
        self._ticks = 0
        self.start_driver()

    def start_driver(self) -> None:
        """Start a robot client, as a new process does; it replaces the current one."""
        self._recoveries, self._enabled = 0, False
        if not self.controller.script.running:
            self.arm.connect()
        self._box = Mailbox(Mailbox.allocate())
        self.driver = ArmDriver(self.config, self.arm, self._box, lambda: self.arm.now)
        self.driver_runs = True
        """False for a robot client whose process was killed or stalls."""
        self._request(np.zeros(2), 0.0)
        self.driver.cycle()

    @property
    def now(self) -> float:
        """Emulated time, s."""
        return self.arm.now

    @property
    def state(self) -> DriverState:
        """State of the robot client."""
        return self.driver.supervisor.state

    @property
    def fault(self) -> Fault:
        """Reason for a HOLD or a FAULT."""
        return self.driver.supervisor.fault

    @property
    def transitions(self) -> list[StateChange]:
        """Last changes of the state with their reasons, the newest last."""
        return self._box.transitions

    def get_observation(self) -> RobotObservation:
        """Return the newest observation."""
        return self._box.observation

    @property
    def true_position(self) -> Array:
        """True position (3,) of the paddle, table frame, m."""
        return self.setup.mounting.to_table(self.controller.arm.pose[:3, 3])

    @property
    def true_velocity(self) -> Array:
        """True velocity (2,) of the paddle, table frame, m/s."""
        return self.setup.mounting.rotate_to_table(self.controller.arm.twist)[:2]

    def enable(self) -> None:
        """Accept commands from now on."""
        self._enabled = True
        self._request(np.zeros(2), 0.0)

    def disable(self) -> None:
        """Brake and accept no commands."""
        self._enabled = False
        self._request(np.zeros(2), 0.0)

    def send_action(self, velocity: Array, seconds: float = 0.05) -> None:
        """Command a velocity.

        Args:
            velocity: Target velocity (2,), table frame, m/s.
            seconds: Time of a linear ramp to the velocity, s.
        """
        self._request(velocity, seconds)

    def _request(self, velocity: Array, seconds: float) -> None:
        self._box.request = Request(
            *(float(velocity[0]), float(velocity[1]), seconds, self.now),
            *(float(self._enabled), float(self._recoveries), 0.0),
        )

    def recover(self) -> None:
        """Request a recovery, as an operator does."""
        if self.driver.is_over:
            self.start_driver()
            return
        self._recoveries += 1
        self.disable()

    def switch(self, fault: str, on: bool = True) -> None:
        """Switch a fault of the controller on or off."""
        FAULTS[fault].switch(self.controller, on)

    def advance(self, seconds: float) -> None:
        """Advance emulated time by some seconds."""
        for _ in range(round(seconds / DT)):
            runs = self.driver_runs and not self.driver.is_over
            if self._ticks % EVERY == 0 and runs:
                self.driver.cycle()
            self.arm.advance(DT)
            self._ticks += 1

    def drive_to(
        self, position: Array, seconds: float = 5.0, near: float = 0.004
    ) -> bool:
        """Move the paddle to a position; return True if it arrived.

        Args:
            position: Target position (2,), table frame, m.
            seconds: Longest time of the movement, s.
            near: Largest distance from the target that counts as arrived, m.
        """
        self.enable()
        until = self.now + seconds
        while self.now < until:
            error = np.asarray(position) - self.true_position[:2]
            left = float(np.linalg.norm(error))
            if left < near and np.linalg.norm(self.true_velocity) < 0.01:
                return True
            self.send_action(error * min(0.25 / max(left, 1e-9), 3.0), 0.02)
            self.advance(0.02)
        return False
