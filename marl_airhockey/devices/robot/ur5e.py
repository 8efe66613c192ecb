"""UR5e over the real-time interface of its controller, by ur-rtde.

What its client does silently is worked around here, each where a comment says so. It
must live in a process of its own: after one lost connection it reconnects for ever.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from marl_airhockey.core.errors import require
from marl_airhockey.devices.robot.arm import ArmFault, Reading
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from rtde_control import RTDEControlInterface

LOOK_AHEAD = 0.05
"""s; longer is smoother and later"""
GAIN = 300
"""Gain of the position loop"""
WATCHDOG = 10.0
"""Hz: the controller itself ends the program if commands come more rarely"""
CYCLE = 0.006
"""Time that the controller's clock must go on between two commands, s"""
ARRIVED = 0.02
"""Time after which the reason of a refusal has arrived, s"""
COMPLIANCE = 0.15
"""Largest speed of the compliant axis, m/s"""
STOP = 5.0
"""Deceleration of joints in a halt, rad/s2"""
VARIABLES = (
    *("timestamp", "actual_TCP_pose", "actual_TCP_speed", "actual_TCP_force"),
    "actual_q",
    *("safety_status_bits", "safety_mode", "runtime_state", "robot_status_bits"),
)


class PoseReader:
    """Reader of where an arm's tool is, which moves nothing.

    The tool's centre is the one that is set at the pendant: the paddle's foot.

    Args:
        host: address of its controller.

    Raises:
        RuntimeError: ur-rtde is not installed, or no controller answers.
    """

    def __init__(self, host: str) -> None:
        require("rtde_receive", "hardware")
        from rtde_receive import RTDEReceiveInterface

        self._receive = RTDEReceiveInterface(
            host, 125.0, ["timestamp", "actual_TCP_pose", "actual_TCP_speed"]
        )

    def pose(self) -> Array:
        """Return the pose (6,) of the tool's centre, base frame, m and rad."""
        return np.array(self._receive.getActualTCPPose())

    def read(self) -> tuple[float, Array, Array]:
        """Return the robot's time, s, the pose (6,) and the velocity (6,), per s.

        A time that stands still is a robot that is silent.
        """
        velocity = np.array(self._receive.getActualTCPSpeed())
        return self._receive.getTimestamp(), self.pose(), velocity

    def close(self) -> None:
        """Disconnect."""
        self._receive.disconnect()


class Ur5e:
    """UR5e as an `arm.Arm`.

    Args:
        host: address of its controller.
        tool: (6,) pose of the tool's centre in the flange's frame, m and rad.
        payload: mass of the tool, kg.

    Raises:
        RuntimeError: ur-rtde is not installed, or no controller answers.
    """

    def __init__(self, host: str, tool: Array, payload: float) -> None:
        # Constructors hold Python's lock until they have connected.
        require("rtde_control", "hardware")
        from rtde_receive import RTDEReceiveInterface

        self._host, self._tool = host, [float(x) for x in tool]
        self._payload = payload
        self._receive = RTDEReceiveInterface(host, 500.0, list(VARIABLES))
        self._program: RTDEControlInterface | None = None
        if self._stop() is ArmFault.NONE:
            self._control()

    def _control(self) -> RTDEControlInterface:
        """Return the program on the controller, started when it is first needed.

        An arm that is stopped starts none.
        """
        if self._program is None:
            from rtde_control import RTDEControlInterface

            program = RTDEControlInterface(self._host)
            program.setTcp(self._tool)
            program.setPayload(self._payload, [0.0, 0.0, self._tool[2] / 2])
            program.zeroFtSensor()
            program.setWatchdog(WATCHDOG)
            self._program = program
        return self._program

    def read(self) -> Reading:
        # After a loss these return the last values without an error: only the stamp
        # tells that time goes on.
        r = self._receive
        return Reading(
            r.getTimestamp(),
            np.array(r.getActualTCPPose()),
            np.array(r.getActualTCPSpeed()),
            np.array(r.getActualTCPForce()),
            np.array(r.getActualQ()),
            self._fault(),
        )

    def _fault(self) -> ArmFault:
        stop = self._stop()
        if stop is ArmFault.NONE and not self._control().isProgramRunning():
            return ArmFault.PROGRAM_LOST
        return stop

    def _stop(self) -> ArmFault:
        if self._receive.isEmergencyStopped():
            return ArmFault.EMERGENCY_STOP
        if self._receive.isProtectiveStopped():
            return ArmFault.PROTECTIVE_STOP
        return ArmFault.NONE

    def press(self, frame: Array, newtons: float) -> None:
        wrench = [0.0, 0.0, -abs(newtons), 0.0, 0.0, 0.0]
        limits = [2.0, 2.0, COMPLIANCE, 1.0, 1.0, 1.0]
        self._control().forceMode(list(frame), [0, 0, 1, 0, 0, 0], wrench, 2, limits)
        self._wait_cycle()

    def _wait_cycle(self) -> None:
        """Wait until the controller has read its registers.

        Of two commands in one of its cycles it takes the last alone.
        """
        began, until = self._receive.getTimestamp(), time.monotonic() + 0.05
        while self._receive.getTimestamp() - began < CYCLE and time.monotonic() < until:
            time.sleep(0.0005)

    def follow(self, pose: Array, seconds: float) -> bool:
        # The client passes numbers that are not finite, and its own limits of speed
        # and acceleration do nothing: both are the shaper's.
        if not np.isfinite(pose).all():
            return False
        sent = self._control().servoL(list(pose), 0.5, 0.5, seconds, LOOK_AHEAD, GAIN)
        if not sent:
            time.sleep(ARRIVED)
        return bool(sent)

    def halt(self) -> None:
        # `stopL` brakes joints; this is the one that does what its name says.
        self._control().servoStop(STOP)
        self._control().forceModeStop()

    def unlock(self) -> str:
        from dashboard_client import DashboardClient

        board = DashboardClient(self._host)
        board.connect()
        try:
            board.closeSafetyPopup()
            board.unlockProtectiveStop()
        except RuntimeError as error:
            return str(error)
        finally:
            board.disconnect()
        # The old command still stands in the registers and would run at once.
        if self._program is not None:
            self._program.servoStop(STOP)
            time.sleep(0.05)
            self._program.reuploadScript()
            time.sleep(0.3)
            self._program.setWatchdog(WATCHDOG)
        else:
            time.sleep(0.05)
            self._control()
        return ""

    def close(self) -> None:
        if self._fault() is ArmFault.NONE:
            self.halt()
            self._control().stopScript()
        self._receive.disconnect()
