"""Control script: the registers by which a client of ur_rtde moves the arm.

The client uploads a script of URScript and then writes a command's number and its
arguments into input registers. The script itself is not interpreted here: what it does
with the registers is done by `ControlScript`, once in every period of the controller.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator

import numpy as np

from marl_airhockey.lab.ur_controller.arm import (
    DT,
    Arm,
    Force,
    Halt,
    Line,
    Safety,
    Speed,
)
from marl_airhockey.types import Array

READY, DONE = 1, 2
"""Values of the output register 0"""
EXIT = 255
"""Number of the command that ends the script"""
DEAD_TIME = 0.004
"""Part of the half-rise of `servoL` that no look-ahead explains: of 34 ms at a
look-ahead of 0.03 s on the arm's relatives, s"""
Waiting = Generator[None, None, None]


class ControlScript:
    """Script of a client that runs on the controller.

    Args:
        arm: what it moves.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.inputs_int, self.inputs_double = [0] * 48, np.zeros(48)
        self.outputs_int, self.outputs_double = [0] * 48, np.zeros(48)
        self.counts: Counter[int] = Counter()
        """Number of times that each command was run."""
        self.silence = 0.0
        """Time since the last write of a command's number, s, in periods of the
        controller: a real one is always served, and what this one sleeps through is no
        silence of its client's."""
        self._run: Waiting | None = None
        self._watchdog = 0.0
        """Least rate of commands, Hz; 0 without a watchdog"""
        self._real_time: dict[int, Callable[[], None]] = {
            6: self._force,
            10: self._speed,
            24: self._servo,
        }
        """Commands that are not acknowledged"""
        self._regular: dict[int, Callable[[], Waiting | None]] = {
            3: self._line,
            7: self._stiffen,
            8: _nothing,
            15: self._halt,
            16: self._halt,
            17: self._load,
            29: self._tool,
            31: self._protect,
            33: self._halt,
            34: self._halt,
            35: self._guard,
            36: self._safe,
        }

    @property
    def running(self) -> bool:
        """True while the script runs."""
        return self._run is not None

    def start(self) -> None:
        """Run the script that was uploaded."""
        self._run, self._watchdog = self._loop(), 0.0

    def kill(self) -> None:
        """End the script; the arm brakes. Its registers keep what they hold."""
        if self.running:
            self._run, self._watchdog = None, 0.0
            self.outputs_int[0] = 0
            self.arm.motion, self.arm.force = Halt(), None

    def step(self) -> None:
        """Go on by a period of the controller."""
        self.silence += DT
        if self._watchdog and self.silence > 1.0 / self._watchdog:
            self.kill()
        if self._run is not None:
            try:
                next(self._run)
            except StopIteration:
                self.kill()

    def _loop(self) -> Waiting:
        self.outputs_int[0], self.outputs_int[2] = READY, 1 << 16
        executed = False
        while self.running:
            command = self.inputs_int[0]
            if command in self._real_time:
                self.counts[command] += 1
                self._real_time[command]()
                self.outputs_int[0] = READY
            elif command == 0:
                executed, self.outputs_int[0] = False, READY
            elif not executed:
                executed = True
                self.counts[command] += 1
                if command == EXIT:
                    return
                run = self._regular.get(command, _nothing)()
                if run is not None:
                    yield from run
                self.outputs_int[0] = DONE
            yield

    def _pose(self) -> Array:
        return self.inputs_double[:6].copy()

    def _servo(self) -> None:
        half_rise = float(self.inputs_double[9]) + DEAD_TIME
        if not self.arm.servo(self._pose(), half_rise):
            # get_inverse_kin raises and ends the script; the client is not told.
            self.kill()

    def _speed(self) -> None:
        self.arm.motion = Speed(self._pose(), float(self.inputs_double[6]))

    def _force(self) -> None:
        d, wanted = self.inputs_double, bool(self.inputs_int[4])
        force = Force(self._pose(), float(d[8]), float(d[14]))
        self.arm.press(force if wanted else None)

    def _stiffen(self) -> None:
        self.arm.press(None)

    def _line(self) -> Waiting:
        d = self.inputs_double
        self.arm.motion = Line(self._pose(), float(d[6]), float(d[7]))
        while isinstance(self.arm.motion, Line):
            yield

    def _halt(self) -> Waiting:
        self.arm.motion = Halt(max(float(self.inputs_double[0]), 0.1))
        while not self.arm.at_rest:
            yield

    def _tool(self) -> None:
        self.arm.mount(self._pose())

    def _load(self) -> None:
        self.arm.payload = float(self.inputs_double[0])

    def _protect(self) -> None:
        self.arm.stop(Safety.PROTECTIVE_STOP, "asked for by the script")

    def _guard(self) -> None:
        self._watchdog, self.silence = float(self.inputs_double[0]), 0.0

    def _safe(self) -> None:
        self.outputs_int[1] = int(self.arm.reachable(self._pose()))


def _nothing() -> None:
    """Do nothing: a command whose effect is not simulated."""
