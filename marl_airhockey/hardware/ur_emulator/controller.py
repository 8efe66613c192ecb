"""Controller of an emulated arm: its safety, its script and its faults, without ports.

`ports.Ports` steps it in real time, `in_process.InProcessArm` in emulated time.
"""

from __future__ import annotations

import math
import re
from sys import stderr
from typing import Any

from marl_airhockey.hardware.robot.kinematics import pose_vector
from marl_airhockey.hardware.ur_emulator.arm import DT, EmulatedArm
from marl_airhockey.hardware.ur_emulator.safety import SAFETY_BITS, Safety
from marl_airhockey.hardware.ur_emulator.script import ControlScript

VERSION = (5, 12, 2, 1101534)
"""Version of PolyScope that is emulated."""
STOPPED, PLAYING = 1, 2
"""Runtime states."""
RUNNING, POWER_OFF = 7, 3
"""Robot modes."""
JOINT_RUNNING = 253
"""Mode of a joint that moves as commanded."""
SPACING = 4
"""Number of periods between two commands of a client that sends 125 per second."""
OFFSET = re.compile(r"reg_offset_int\s*=\s*(?:#[^\n]*\n)?\s*(\d+)")
"""Pattern of the number of the first register in the script of ur_rtde."""
PROGRAM = re.compile(r"^\s*(def|sec) \w+\(|reg_offset_int", re.MULTILINE)
"""Pattern of the beginning of a script."""
REPLACING = 50
"""Number of periods for which no script runs when one replaces another."""
OFFSETS = 0, 24
"""First registers that a script of ur_rtde may use."""
STALL_EVERY = 250
"""Number of periods from one stall to the next, a fault."""
UNLOCK_AFTER = 5.0
"""Least duration of a protective stop, s, as on a real controller."""


class Controller:
    """Controller of an arm.

    Args:
        arm: Arm that is controlled.
        version: Reported version of PolyScope.
    """

    def __init__(
        self, arm: EmulatedArm, version: tuple[int, int, int, int] = VERSION
    ) -> None:
        self.arm, self.script, self.version = arm, ControlScript(arm), version
        arm.rehearse()
        self.ticks = 0
        """Number of periods since the start."""
        self.remote = True
        """True in remote control; the pendant can switch to local control."""
        self.powered = True
        """True while the arm has power."""
        self.silent = False
        """True if no data is sent, a fault."""
        self.delay = 0.0
        """Additional latency of the data, a fault, s."""
        self.stall = 0.0
        """Time for which scripts and data stall twice a second, a fault, s."""
        self._stall_from = 0
        self.refuses = False
        """True if connections are closed and refused, a fault."""
        self.forgets = False
        """True if new connections get no data, a fault."""
        self.first_after = 0.0
        """Time after which a new connection gets its first data, a fault, s."""
        self.uploads = 0
        """Number of scripts that clients have sent."""
        self._next_script: tuple[int, int] | None = None
        self._outputs = 0
        self._stopped_at = 0.0
        self._pending: list[dict[str, Any]] = []

    @property
    def time(self) -> float:
        """Time since the start, controller's clock, s."""
        return self.ticks * DT

    def upload(self, text: str) -> None:
        """Replace the running script by one that a client has sent."""
        if not (PROGRAM.search(text) and self.ready):
            return
        self.uploads += 1
        waits = REPLACING if self.script.running else 0
        self.script.kill()
        # Only the script of ur_rtde is run, which begins with this text.
        found = OFFSET.search(text)
        if found and int(found[1]) in OFFSETS:
            self._next_script = self.ticks + waits, int(found[1])
            self._start_script()

    def _start_script(self) -> None:
        """Start the script that was sent last, when it is due."""
        if self._next_script and self.ticks >= self._next_script[0] and self.ready:
            self.script.start(self._next_script[1])
            self._next_script = None

    @property
    def ready(self) -> bool:
        """True if a script can run."""
        return self.powered and self.arm.safety is Safety.NORMAL

    def switch_power(self, on: bool) -> None:
        """Switch the arm's power on or off; without it the brakes hold the arm."""
        self.powered = on
        if not on:
            self._next_script = None
            self.script.kill()

    def stop(self, mode: Safety, why: str) -> None:
        """Stop the arm for safety, as its own supervision does."""
        self.arm.stop(mode, why)
        self._note_stop()

    def _note_stop(self) -> None:
        self._stopped_at = self.time
        self._next_script = None
        self.script.kill()
        print(f"ur-emulator: {self.arm.safety.name}: {self.arm.stopped}", file=stderr)

    def unlock(self) -> bool:
        """Release a protective stop; return False within `UNLOCK_AFTER` s of it."""
        if self.arm.safety is not Safety.PROTECTIVE_STOP:
            return True
        if self.time - self._stopped_at < UNLOCK_AFTER:
            return False
        self.arm.release()
        return True

    def set_stall(self, seconds: float) -> None:
        """Start stalls of some seconds, now and twice a second; 0 ends them."""
        self.stall, self._stall_from = seconds, self.ticks

    @property
    def stalled(self) -> bool:
        """True while scripts and data stall; the joints move to their target."""
        passed = (self.ticks - self._stall_from) % STALL_EVERY
        return passed * DT < self.stall

    def take(self, values: dict[str, Any]) -> None:
        """Store values that a client has written, by name, for the next period."""
        self._pending.append(values)

    def step(self, behind: bool = False) -> None:
        """Run one period: inputs, script, arm, safety.

        Args:
            behind: True if this process is behind the clock.
        """
        self.ticks += 1
        # All values of a period are latched at its end: the last ones count. A real
        # controller is never late. Values that accumulated while this one was late are
        # applied one after the other, as the arm would leap otherwise.
        count = len(self._pending) if not behind else int(self.ticks % SPACING == 0)
        if not self.stalled:
            for values in self._pending[:count]:
                self._write(values)
            del self._pending[:count]
            self._start_script()
            self.script.step()
        safe = self.arm.safety
        self.arm.step()
        if self.arm.safety is not Safety.NORMAL and safe is Safety.NORMAL:
            self._note_stop()

    def _write(self, values: dict[str, Any]) -> None:
        for name, value in values.items():
            kind, _, index = name.rpartition("_")
            if kind == "input_int_register":
                self.script.inputs_int[int(index)] = value
                if int(index) == self.script.offset:
                    self.script.silence = 0.0
            elif kind == "input_double_register":
                self.script.inputs_double[int(index)] = value
        slider = values.get("speed_slider_fraction", math.nan)
        if values.get("speed_slider_mask") and math.isfinite(slider):
            self.arm.speed_fraction = min(max(slider, 0.0), 1.0)
        mask = values.get("standard_digital_output_mask", 0)
        level = values.get("standard_digital_output", 0)
        self._outputs = (self._outputs & ~mask) | (level & mask)

    def values(self) -> dict[str, Any]:
        """Return the variables that clients can read, by name."""
        arm, script = self.arm, self.script
        ints, doubles = script.outputs_int, script.outputs_double
        status = (1 if self.powered else 0) | (2 if script.running else 0) | 8
        return {
            "timestamp": self.time,
            "actual_q": arm.angles,
            "target_q": arm.target,
            "actual_qd": arm.speeds,
            "target_qd": arm.speeds,
            "target_qdd": arm.rates,
            "actual_TCP_pose": arm.reading.pose,
            "target_TCP_pose": pose_vector(arm.pose),
            "actual_TCP_speed": arm.twist,
            "target_TCP_speed": arm.twist,
            "actual_TCP_force": arm.measured_force,
            "ft_raw_wrench": arm.reading.force,
            "runtime_state": PLAYING if script.running else STOPPED,
            "robot_status_bits": status,
            "safety_status_bits": SAFETY_BITS[arm.safety],
            "safety_mode": int(arm.safety),
            "robot_mode": RUNNING if self.powered else POWER_OFF,
            # Only the slider slows the arm.
            "speed_scaling": arm.speed_scaling,
            "target_speed_fraction": 1.0,
            "speed_slider_fraction": arm.speed_fraction,
            "actual_digital_output_bits": self._outputs,
            "payload": arm.payload,
            "tcp_offset": arm.tool,
            "safety_status": int(arm.safety),
            "joint_mode": JOINT_RUNNING,
            **{f"output_int_register_{i}": ints[i] for i in range(48)},
            **{f"output_double_register_{i}": doubles[i] for i in range(48)},
        }
