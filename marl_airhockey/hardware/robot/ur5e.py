"""Arm driver of a UR5e, over the real-time interface of its controller (ur-rtde).

ur-rtde has defects that it does not report. Comments mark the workarounds. It must run
in a separate process, because it reconnects forever after a lost connection.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from marl_airhockey.hardware.robot.arm import ArmFault, Reading
from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.sim.core.errors import require
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from rtde_control import RTDEControlInterface

WATCHDOG = 10.0
"""Least rate of commands, Hz; below it, the controller ends the control script."""
CYCLE = 0.02
"""Least time between two commands on the controller's clock, s: ten of its cycles, as a
reading of the clock may be a few cycles old."""
LONGEST = 0.2
"""Longest wait for that time, s; a silent robot is a fault after a shorter time."""
ARRIVED = 0.02
"""Time after which the reason of a rejected command has arrived, s."""
STOP = 5.0
"""Deceleration of joints in a halt, rad/s2."""
ANSWER = 2000
"""Longest time until a dashboard responds, ms."""
OLDEST, NEWER = (5, 4), (6, 0)
"""Oldest supported version of PolyScope, and the first later one that is not."""
VARIABLES = (
    *("timestamp", "actual_TCP_pose", "actual_TCP_speed", "actual_TCP_force"),
    "actual_q",
    *("safety_status_bits", "safety_mode", "runtime_state", "robot_status_bits"),
    *("speed_scaling", "target_speed_fraction"),
)


class PoseReader:
    """Reader of the tool pose of an arm, which moves nothing.

    The tool's centre is the one that is set at the pendant: the paddle's foot.

    Args:
        host: Address of the controller.

    Raises:
        RuntimeError: ur-rtde is not installed, or no controller responds.
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

        If the time does not advance, the robot is silent.
        """
        velocity = np.array(self._receive.getActualTCPSpeed())
        return self._receive.getTimestamp(), self.pose(), velocity

    def close(self) -> None:
        """Disconnect."""
        self._receive.disconnect()


def check_controller(host: str) -> None:
    """Check that a robot client can use a controller, before anything connects.

    Raises:
        RuntimeError: ur-rtde is not installed, no controller responds, its version is
            not supported, it is not in remote control, or the arm has no power.
    """
    require("dashboard_client", "hardware")
    from dashboard_client import DashboardClient

    board, robot = DashboardClient(host), f"robot at {host}"
    try:
        board.connect(ANSWER)
        version = board.polyscopeVersion()
    except RuntimeError as error:
        raise RuntimeError(
            f"{robot}: no arm answers; is it switched on, and in this network?"
        ) from error
    try:
        found = re.search(r"(\d+)\.(\d+)\.", version)
        number = (int(found[1]), int(found[2])) if found else (0, 0)
        if not OLDEST <= number < NEWER:
            raise RuntimeError(
                f"{robot}: PolyScope {version.strip()!r} is not supported; this driver "
                f"needs {OLDEST[0]}.{OLDEST[1]} or newer, below {NEWER[0]}"
            )
        if not board.isInRemoteControl():
            raise RuntimeError(
                f"{robot}: it is in local control; switch it to remote control at the "
                "pendant"
            )
        mode = board.robotmode()
        if "RUNNING" not in mode:
            raise RuntimeError(
                f"{robot}: {mode.strip()}; switch the arm on and release its brakes at "
                "the pendant"
            )
    finally:
        board.disconnect()


class Ur5e:
    """Arm driver of a UR5e.

    Args:
        config: Configuration of the robot.

    Raises:
        RuntimeError: ur-rtde is not installed, or no controller responds.
    """

    def __init__(self, config: RobotConfig) -> None:
        # Constructors hold the global interpreter lock until they have connected.
        require("rtde_control", "hardware")
        from rtde_receive import RTDEReceiveInterface

        self._host, self._tool = config.host, [float(x) for x in config.tool]
        self._payload, self._servo = config.payload, config.servo
        self._receive = RTDEReceiveInterface(self._host, 500.0, list(VARIABLES))
        self._program: RTDEControlInterface | None = None
        self._lost = False
        if self._stop() is ArmFault.NONE:
            self._control()

    def _control(self) -> RTDEControlInterface:
        """Return the client of the control script, which starts when first needed.

        A stopped arm does not start it.
        """
        if self._program is None:
            from rtde_control import RTDEControlInterface

            program = RTDEControlInterface(self._host)
            program.setTcp(self._tool)
            program.setPayload(self._payload, [0.0, 0.0, self._tool[2] / 2])
            program.setWatchdog(WATCHDOG)
            self._program = program
        return self._program

    def read(self) -> Reading:
        # After a lost connection these return the last values without an error. Only
        # the stamp shows whether they are new.
        r = self._receive
        return Reading(
            r.getTimestamp(),
            np.array(r.getActualTCPPose()),
            np.array(r.getActualTCPSpeed()),
            np.array(r.getActualTCPForce()),
            np.array(r.getActualQ()),
            self._fault(),
            # Speed slider, times all other factors that slow the arm.
            r.getSpeedScaling() * r.getTargetSpeedFraction(),
        )

    def _fault(self) -> ArmFault:
        if self._lost or not self._receive.isConnected():
            return ArmFault.CONNECTION_LOST
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

    def zero_force_sensor(self) -> None:
        self._control().zeroFtSensor()

    def press(self, frame: Array, newtons: float) -> None:
        wrench = [0.0, 0.0, -abs(newtons), 0.0, 0.0, 0.0]
        limits = [2.0, 2.0, self._servo.compliance, 1.0, 1.0, 1.0]
        program = self._control()
        axes = [0, 0, 1, 0, 0, 0]
        self._obeys(lambda: program.forceMode(list(frame), axes, wrench, 2, limits))
        self._wait_cycle()

    def release(self, pose: Array) -> None:
        # Send the pose first: a stiff arm moves to the last height that it was sent.
        if self.follow(pose, CYCLE):
            self._wait_cycle()
            self._obeys(self._control().forceModeStop)

    def _obeys(self, command: Callable[[], bool]) -> bool:
        """Run a command of the client; return True if the controller accepts it."""
        try:
            return command()
        except RuntimeError:
            # The connection is lost. The client reconnects forever, and uploads its
            # script each time, so it cannot be used again.
            self._lost = True
            return False

    def _wait_cycle(self) -> None:
        """Wait until the controller has read its registers.

        Of two commands in one of its cycles it executes only the last.
        """
        began, until = self._receive.getTimestamp(), time.monotonic() + LONGEST
        while self._receive.getTimestamp() - began < CYCLE and time.monotonic() < until:
            time.sleep(0.0005)

    def follow(self, pose: Array, seconds: float) -> bool:
        # The client accepts numbers that are not finite, and its limits of speed and
        # acceleration have no effect. The shaper limits both.
        if not np.isfinite(pose).all():
            return False
        loop, program = (self._servo.look_ahead, self._servo.gain), self._control()
        sent = self._obeys(lambda: program.servoL(list(pose), 0.5, 0.5, seconds, *loop))
        if not (sent or self._lost):
            time.sleep(ARRIVED)
        return sent

    def halt(self) -> None:
        # `stopL` brakes joints; `servoStop` does what its name suggests.
        program = self._control()
        if self._obeys(lambda: program.servoStop(STOP)):
            self._obeys(program.forceModeStop)

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
        # The old command is still in the registers and would run immediately.
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
