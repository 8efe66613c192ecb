"""Arm driver of an emulated arm in this process, in emulated time.

It is a client of a controller like `hardware.robot.Ur5e`, but without ports, threads
and clocks. Minutes of motion take seconds, and the same calls give the same motion.
Time passes in `advance`, and in the calls that wait for the controller.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.hardware.robot.arm import ArmFault, Reading
from marl_airhockey.hardware.robot.config import ServoSettings
from marl_airhockey.hardware.robot.ur5e import STOP, WATCHDOG
from marl_airhockey.hardware.ur_emulator.arm import DT
from marl_airhockey.hardware.ur_emulator.controller import PLAYING, Controller
from marl_airhockey.hardware.ur_emulator.dashboard import LOCKED
from marl_airhockey.hardware.ur_emulator.safety import Safety
from marl_airhockey.types import Array

SCRIPT = "reg_offset_int = 0"
"""Text by which an emulated controller recognizes a control script."""
FAULTS = {
    Safety.NORMAL: ArmFault.NONE,
    Safety.PROTECTIVE_STOP: ArmFault.PROTECTIVE_STOP,
    Safety.ROBOT_EMERGENCY_STOP: ArmFault.EMERGENCY_STOP,
}


def _registers(integers: int, doubles: int) -> list[str]:
    names = [f"input_int_register_{i}" for i in range(integers)]
    return names + [f"input_double_register_{i}" for i in range(doubles)]


SERVO, FORCE = _registers(1, 11), _registers(8, 18)
REGULAR, NONE = _registers(1, 1), _registers(1, 0)
"""Registers that commands write."""


class Sample(NamedTuple):
    """Sample of a controller's variables."""

    time: float
    """Time at which it can be read, s."""
    values: dict[str, Any]


class InProcessArm:
    """Arm driver of an emulated arm.

    Args:
        controller: Controller, which only this object steps.
        servo: Settings of the control loops; None for the defaults.
    """

    def __init__(
        self, controller: Controller, servo: ServoSettings | None = None
    ) -> None:
        self.controller, self._servo = controller, servo or ServoSettings()
        self.now = 0.0
        """Emulated time, s."""
        self._samples: deque[Sample] = deque()
        self._values = controller.values()
        self.connect()

    def connect(self) -> None:
        """Start the control script on the controller, as a new client does."""
        self.controller.upload(SCRIPT)
        self._set_watchdog()

    def _send(self, registers: list[str], *numbers: float) -> None:
        if not self.controller.refuses:
            self.controller.take(dict(zip(registers, numbers, strict=True)))

    def _command(self, number: int, argument: float = 0.0) -> None:
        """Run a command that is acknowledged."""
        self._send(REGULAR, number, argument)
        self.advance(3 * DT)
        self._send(NONE, 0)
        self.advance(2 * DT)

    def _set_watchdog(self) -> None:
        self._command(35, WATCHDOG)

    def advance(self, seconds: float) -> None:
        """Advance emulated time."""
        controller = self.controller
        for _ in range(round(seconds / DT)):
            self.now += DT
            controller.step()
            mute = controller.silent or controller.refuses or controller.stalled
            if not mute:
                values = controller.values()
                self._samples.append(Sample(self.now + controller.delay, values))
        while self._samples and self._samples[0].time <= self.now:
            self._values = self._samples.popleft().values

    def read(self) -> Reading:
        """Return the newest reading that has arrived."""
        values = self._values
        return Reading(
            values["timestamp"],
            np.array(values["actual_TCP_pose"]),
            np.array(values["actual_TCP_speed"]),
            np.array(values["actual_TCP_force"]),
            np.array(values["actual_q"]),
            self._fault(),
            values["speed_scaling"] * values["target_speed_fraction"],
        )

    def _fault(self) -> ArmFault:
        if self.controller.refuses:
            return ArmFault.CONNECTION_LOST
        safety = FAULTS[Safety(self._values["safety_mode"])]
        running = self._values["runtime_state"] == PLAYING
        if safety is ArmFault.NONE and not running:
            return ArmFault.PROGRAM_LOST
        return safety

    def press(self, frame: Array, newtons: float) -> None:
        """Become compliant along the z axis of a frame (6,) and press down."""
        limits = 2.0, 2.0, self._servo.compliance, 1.0, 1.0, 1.0
        wrench = 0.0, 0.0, -abs(newtons), 0.0, 0.0, 0.0
        self._send(FORCE, 6, 2, 0, 0, 1, 0, 0, 0, *frame, *wrench, *limits)
        self.advance(4 * DT)

    def follow(self, pose: Array, seconds: float) -> bool:
        """Follow a pose (6,) until the next one ``seconds`` later.

        Return False if the controller rejects it.
        """
        if not np.isfinite(pose).all() or self._fault():
            return False
        loop = self._servo.look_ahead, self._servo.gain
        self._send(SERVO, 24, *pose, 0.5, 0.5, seconds, *loop)
        return True

    def zero_force_sensor(self) -> None:
        """Zero the force sensor at the present force."""
        self._command(8)

    def release(self, pose: Array) -> None:
        """End compliance and hold a pose (6,)."""
        if self.follow(pose, DT):
            self.advance(4 * DT)
            self._command(7)

    def halt(self) -> None:
        """Brake to rest and end compliance."""
        self._command(16, STOP)
        self._command(7)

    def unlock(self) -> str:
        """Release a protective stop; return "", or the reason of a failure."""
        if not self.controller.unlock():
            return LOCKED
        self._send(NONE, 0)
        self.advance(0.05)
        self.connect()
        return ""

    def close(self) -> None:
        """End the control script."""
        self._command(255)
