"""Control script of ur_rtde: registers by which a client moves the arm.

The client uploads a script in URScript and then writes a command's number and its
arguments into input registers. The script itself is not interpreted. `ControlScript`
processes the registers in its place, once in every period of the controller.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Generator

import numpy as np

from marl_airhockey.hardware.robot.kinematics import forward, pose_of, pose_vector
from marl_airhockey.hardware.ur_emulator.arm import DT, EmulatedArm
from marl_airhockey.hardware.ur_emulator.motions import (
    Force,
    Halt,
    JointLine,
    JointSpeed,
    Line,
    Motion,
    Servo,
    Speed,
)
from marl_airhockey.hardware.ur_emulator.poses import Poses
from marl_airhockey.hardware.ur_emulator.safety import Safety
from marl_airhockey.types import Array

READY, DONE = 1, 2
"""Values of the output register 0."""
EXIT = 255
"""Number of the command that ends the script."""
DEAD_TIME = 0.004
"""Part of the half-rise time of `servoL` that the look-ahead does not explain, s;
related arms have a half-rise time of 34 ms at a look-ahead of 0.03 s."""
LOOK_AHEAD = 0.03, 0.2
"""Least and largest look-ahead that `servoL` accepts, s."""
LARGEST = 1e6
"""Largest valid argument of a command."""
Waiting = Generator[None, None, None]
"""Command that takes several periods."""


class ScriptError(Exception):
    """Error of a running script, which ends it."""


class ControlScript:
    """Script of a client that runs on the controller.

    Args:
        arm: Arm that is moved.
    """

    def __init__(self, arm: EmulatedArm) -> None:
        self.arm = arm
        self.inputs_int, self.inputs_double = [0] * 48, np.zeros(48)
        self.outputs_int, self.outputs_double = [0] * 48, np.zeros(48)
        self.counts: Counter[int] = Counter()
        """Number of runs of each command."""
        self.silence = 0.0
        """Time since the last write of a command's number, s. It counts periods of the
        controller, so that a delay of this process is not a silence of the client."""
        self.offset = 0
        """First of the registers that the script uses: 0, or 24 for the upper range."""
        self.poses = Poses()
        self.longest_silence = math.inf
        """Time without a command that ends the script with any watchdog, s."""
        self._run: Waiting | None = None
        self._watchdog = 0.0
        """Least rate of commands, Hz; 0 without a watchdog."""
        # Commands that are not acknowledged.
        self._real_time: dict[int, Callable[[], None]] = {
            6: self._force_mode,
            9: self._speed_joints,
            10: self._speed_tool,
            11: self._servo_joints,
            24: self._servo_tool,
            27: lambda: self._report(self.arm.angles),
        }
        self._regular: dict[int, Callable[[], Waiting | None]] = {
            1: self._move_joints,
            2: self._move_joints_to_pose,
            3: self._move_line,
            7: self._end_force_mode,
            8: self.arm.zero_force_sensor,
            15: self._halt,
            16: self._halt,
            17: self._set_payload,
            29: self._set_tool,
            30: self._solve_near,
            31: self._stop_protectively,
            33: self._halt,
            34: self._halt,
            35: self._set_watchdog,
            36: self._check_pose,
            40: lambda: self._report(self.arm.tool),
            43: self._report_pose,
            44: self._report_pose_of,
            46: self._solve,
            47: self._check_steady,
            60: self._check_pose,
        }

    @property
    def running(self) -> bool:
        """True while the script runs."""
        return self._run is not None

    def start(self, offset: int = 0) -> None:
        """Run the script that was uploaded.

        Args:
            offset: First register of the script.
        """
        self.offset = offset
        self._run, self._watchdog = self._loop(), 0.0

    def kill(self) -> None:
        """End the script; the arm brakes, and the registers keep their values."""
        if self.running:
            self._run, self._watchdog = None, 0.0
            self._reply(0)
            self.arm.motion, self.arm.force = Halt(), None

    def step(self) -> None:
        """Run one period of the controller."""
        self.silence += DT
        patience = 1.0 / self._watchdog if self._watchdog else math.inf
        if self.silence > min(patience, self.longest_silence):
            self.kill()
        if self._run is not None:
            try:
                next(self._run)
            except (StopIteration, ScriptError):
                # An error ends a script; its client gets no message.
                self.kill()

    def _loop(self) -> Waiting:
        self._reply(READY)
        self._reply(1 << 16, 2)
        executed = False
        while self.running:
            command = self.inputs_int[self.offset]
            if command in self._real_time:
                self.counts[command] += 1
                self._real_time[command]()
                self._reply(READY)
            elif command == 0:
                executed = False
                self._reply(READY)
            elif not executed:
                executed = True
                self.counts[command] += 1
                if command == EXIT:
                    return
                run = self._regular.get(command, _nothing)()
                if run is not None:
                    yield from run
                self._reply(DONE)
            yield

    def _reply(self, value: int, register: int = 0) -> None:
        self.outputs_int[self.offset + register] = value

    def _six(self, first: int = 0) -> Array:
        first += self.offset
        return _checked(self.inputs_double[first : first + 6].copy())

    def _number(self, index: int) -> float:
        first = self.offset + index
        return float(_checked(self.inputs_double[first : first + 1])[0])

    def _positive(self, index: int) -> float:
        """Return an argument that URScript requires to be above 0."""
        number = self._number(index)
        if number <= 0.0:
            raise ScriptError(f"argument {index}: {number}; expected above 0")
        return number

    @property
    def _half_rise(self) -> float:
        return min(max(self._number(9), LOOK_AHEAD[0]), LOOK_AHEAD[1]) + DEAD_TIME

    def _servo_tool(self) -> None:
        before, following = self.arm.target, isinstance(self.arm.motion, Servo)
        pose = self.poses.take(self._six(), self.silence)
        solved = self.arm.servo(pose, self._half_rise)
        fast = self.poses.too_fast(before, self.arm.target, self.silence)
        if not solved or (following and fast):
            # get_inverse_kin raises and ends the script; the client gets no message.
            self.kill()

    def _servo_joints(self) -> None:
        self.arm.servo_joints(self._six(), self._half_rise)

    def _speed_tool(self) -> None:
        self.arm.motion = Speed(self._six(), self._positive(6))

    def _speed_joints(self) -> None:
        self.arm.motion = JointSpeed(self._six(), self._positive(6))

    def _force_mode(self) -> None:
        force = Force(self._six(), self._number(8), abs(self._number(14)))
        self.arm.press(force if self.inputs_int[self.offset + 4] else None)

    def _end_force_mode(self) -> None:
        self.arm.press(None)

    def _until_done(self, motion: Motion) -> Waiting:
        self.arm.motion = motion
        while self.arm.motion is motion:
            yield

    def _move_line(self) -> Waiting | None:
        if self.arm.solve(self._six()) is None:
            self.kill()
            return None
        line = Line(self._six(), self._positive(6), self._positive(7))
        return self._until_done(line)

    def _move_joints(self) -> Waiting:
        line = JointLine(self._six(), self._positive(6), self._positive(7))
        return self._until_done(line)

    def _move_joints_to_pose(self) -> Waiting | None:
        angles = self.arm.solve(self._six())
        if angles is None:
            self.kill()
            return None
        line = JointLine(angles, self._positive(6), self._positive(7))
        return self._until_done(line)

    def _halt(self) -> Waiting:
        self.arm.motion = Halt(max(self._number(0), 0.1))
        while not self.arm.at_rest:
            yield

    def _set_tool(self) -> None:
        self.arm.mount(self._six())

    def _set_payload(self) -> None:
        self.arm.payload = self._number(0)

    def _set_watchdog(self) -> None:
        self._watchdog, self.silence = self._number(0), 0.0

    def _stop_protectively(self) -> None:
        self.arm.stop(Safety.PROTECTIVE_STOP, "requested by the script")

    def _report(self, six: Array) -> None:
        self.outputs_double[self.offset : self.offset + 6] = six

    def _report_pose(self) -> None:
        self._report(pose_vector(self.arm.pose))

    def _report_pose_of(self) -> None:
        flange, _ = forward(self._six())
        self._report(pose_vector(flange @ pose_of(self._six(6))))

    def _solve(self) -> None:
        self._report_solution(self.arm.solve(self._six()))

    def _solve_near(self) -> None:
        self._report_solution(self.arm.solve(self._six(), self._six(6)))

    def _report_solution(self, angles: Array | None) -> None:
        if angles is None:
            self.kill()
        else:
            self._report(angles)

    def _check_pose(self) -> None:
        self._reply(int(self.arm.solve(self._six()) is not None), 1)

    def _check_steady(self) -> None:
        self._reply(int(self.arm.at_rest), 1)


def _checked(arguments: Array) -> Array:
    """Return the arguments of a command.

    Raises:
        ScriptError: An argument is not finite, or is larger than `LARGEST`.
    """
    if not (np.abs(arguments) <= LARGEST).all():
        raise ScriptError(f"arguments {arguments}; expected finite numbers")
    return arguments


def _nothing() -> None:
    """Do nothing: a command whose effect is not simulated."""
