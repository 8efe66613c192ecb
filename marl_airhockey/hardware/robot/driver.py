"""Robot client: the 125 Hz loop between commands and an arm.

It reads commanded velocities from shared memory and sends shaped poses to the arm. It
brakes when a command is older than 0.15 s, when its caller has ended, when the paddle
leaves the table's plane or does not follow, and when the robot client itself is late.
When the arm is silent or has stopped, it stops and remains stopped
(`supervisor.Supervisor`). It never recovers without the confirmation of an operator,
and never from an emergency stop.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from marl_airhockey.hardware.robot.arm import Arm, ArmFault, Reading
from marl_airhockey.hardware.robot.config import RobotConfig
from marl_airhockey.hardware.robot.mailbox import (
    JOINT_NAMES,
    TRACK,
    DriverState,
    Fault,
    Mailbox,
    Request,
    RobotObservation,
)
from marl_airhockey.hardware.robot.motion import Motion
from marl_airhockey.hardware.robot.supervisor import (
    AWAY,
    LIFTED,
    Readings,
    Supervisor,
)
from marl_airhockey.sim.core.geometry import half_planes
from marl_airhockey.types import Array

RATE = 125.0
"""Number of cycles per second."""
OVERRUN = 0.1
"""Delay of a cycle after which the paddle brakes, s."""
NEW_PROCESS = (Fault.ROBOT_SILENT, Fault.CONNECTION_LOST)
"""Faults after which the robot client ends and must be started again, because ur-rtde
would reconnect and send its script forever."""
MISALIGNED = 0.05
"""Angle between the tool and its orientation on the table above which an arm is not at
the table, rad."""


class ArmDriver:
    """Robot client of one arm.

    Args:
        config: Configuration of the robot.
        arm: Arm that is moved.
        box: Shared memory of requests and observations.
        clock: Function that returns the time, s. A different one emulates time.
    """

    def __init__(
        self,
        config: RobotConfig,
        arm: Arm,
        box: Mailbox,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config, self._arm, self._box, self._clock = config, arm, box, clock
        self._dt = 1.0 / RATE
        self._cycles = self._late = self._refused = self._logged = 0
        self._recovered, self._seen = box.request.recover, 0.0
        self._applied = 0.0
        self._due, reading = clock(), arm.read()
        position = self._position(reading)
        self._motion = Motion(config, self._dt, position)
        self.supervisor = Supervisor(self._due, reading.stamp, self._motion.latest)
        self._track = np.zeros((TRACK, 3))
        self._track[:] = self._due, *position[:2]
        if not self._at_table(reading):
            self.supervisor.fail(self._due, Fault.NOT_AT_TABLE)
        elif reading.fault is ArmFault.NONE and position[2] > LIFTED:
            # Only in free air: on the table, the contact force would be taken as zero.
            arm.zero_force_sensor()

    def _position(self, reading: Reading) -> Array:
        """Return the position (3,) of the paddle, table frame, m."""
        return self._config.mounting.to_table(reading.pose)

    def _at_table(self, reading: Reading) -> bool:
        """Return True for a paddle on or above the workspace, in its orientation."""
        *place, height = self._position(reading)
        corners = tuple((float(x), float(y)) for x, y in self._config.reach)
        normals, offsets = half_planes(corners)
        outside = -float((normals @ place + offsets).min())
        misalignment = self._config.mounting.misalignment(reading.pose)
        return outside < AWAY and -LIFTED < height < AWAY and misalignment < MISALIGNED

    @property
    def is_over(self) -> bool:
        """True after a fault that requires a new robot client."""
        rests = (
            self._motion.shaper.at_rest
            or self.supervisor.fault is Fault.CONNECTION_LOST
        )
        return self.supervisor.fault in NEW_PROCESS and rests

    def wait(self) -> None:
        """Wait for the next cycle."""
        self._due += self._dt
        left = self._due - self._clock()
        if left > 0:
            time.sleep(left)
            return
        if left < -0.5 * self._dt:
            # Missed cycles are skipped: poses in quick succession would be a leap.
            self._late += 1
            self._due = self._clock()
        if left < -OVERRUN:
            self.supervisor.hold(self._clock(), Fault.DRIVER_LATE)

    def cycle(self) -> None:
        """Read the arm, update the state, move the paddle, publish an observation."""
        now, reading = self._clock(), self._arm.read()
        request, supervisor = self._box.request, self.supervisor
        position, before = self._position(reading), supervisor.state
        if before is not DriverState.FAULT:
            # A confirmation is valid only for a stop that the operator could see.
            self._recovered = request.recover
        measured = Readings(
            float(position[2]),
            self._motion.measure(reading.stamp, position),
            not self._motion.shaper.at_rest,
        )
        supervisor.watch_arm(now, reading, measured)
        supervisor.watch_request(now, request, measured)
        if supervisor.state is DriverState.RUNNING:
            self._motion.scale_speed(reading.speed_scaling)
            self._move(now, request)
        elif supervisor.state is not DriverState.FAULT:
            self._come_to_rest(now, reading, position)
        elif (
            supervisor.fault is Fault.PADDLE_OFF_TABLE
            and before is not supervisor.state
        ):
            self._arm.halt()
        elif request.recover > self._recovered:
            self._recovered = request.recover
            self._recover(now)
            # A recovery takes half a second.
            now, reading = self._clock(), self._arm.read()
        elif supervisor.fault is Fault.ROBOT_SILENT and measured.moving:
            # The robot may still receive poses: braking is better than a constant pose.
            self._motion.brake()
            self._send(now)
        self._cycles += 1
        self._publish(now, reading)

    def _move(self, now: float, request: Request) -> None:
        """Move the paddle, pressed on the table, as requested."""
        size = math.hypot(request.vx, request.vy)
        finite = math.isfinite(size) and math.isfinite(request.seconds)
        if request.stamp != self._seen:
            self._seen, self._applied = request.stamp, now
            self._refused += not finite
        if not self.supervisor.pressed_at:
            self._arm.press(self._config.mounting.frame(), self._config.servo.force)
            self.supervisor.pressed_at, self._motion.height = now, 0.0
        if finite:
            left = max(request.stamp + request.seconds - now, 0.0)
            self._motion.step(np.array([request.vx, request.vy]), left)
        else:
            self._motion.brake()
        self._send(now)

    def _come_to_rest(self, now: float, reading: Reading, position: Array) -> None:
        """Brake in the table's plane, then also hold the height of the paddle."""
        self._motion.come_to_rest(reading, position)
        self._send(now)
        if self.supervisor.pressed_at and self._motion.shaper.at_rest:
            self.supervisor.pressed_at = 0.0
            self._motion.height = float(position[2])
            self._arm.release(self._motion.pose)

    def _send(self, now: float) -> None:
        if self._arm.follow(self._motion.pose, self._dt):
            return
        if self.supervisor.state is not DriverState.FAULT:
            fault = self._arm.read().fault
            lost = fault is ArmFault.NONE
            self.supervisor.fail(now, Fault.PROGRAM_LOST if lost else Fault(fault))

    def _recover(self, now: float) -> None:
        """Recover from a stop after a confirmation; never from an emergency stop."""
        fault, reading = self.supervisor.fault, self._arm.read()
        emergency = reading.fault is ArmFault.EMERGENCY_STOP
        if emergency or fault is Fault.EMERGENCY_STOP or fault in NEW_PROCESS:
            return
        if self.supervisor.silent(now):
            # The connection may be unusable; the caller starts a new process.
            return
        stopped = reading.fault is not ArmFault.NONE
        if not self._at_table(reading) or (stopped and self._arm.unlock()):
            return
        self._motion.stay(self._position(self._arm.read()))
        self._due = self._clock()
        self.supervisor.recovered(self._due, bool(self._box.request.enabled))

    def _publish(self, now: float, reading: Reading) -> None:
        mounting, shaper = self._config.mounting, self._motion.shaper
        x, y, z = self._position(reading).tolist()
        vx, vy, _ = mounting.rotate_to_table(reading.velocity).tolist()
        self._track[:-1] = self._track[1:]
        self._track[-1] = now, x, y
        self._box.track = self._track
        if len(self.supervisor.transitions) != self._logged:
            self._logged = len(self.supervisor.transitions)
            self._box.transitions = self.supervisor.transitions
        sent_x, sent_y = shaper.place.tolist()
        sent_vx, sent_vy = shaper.velocity.tolist()
        self._box.observation = RobotObservation(
            state=self.supervisor.state,
            fault=self.supervisor.fault,
            stamp=now,
            robot_time=reading.stamp,
            x=x,
            y=y,
            z=z,
            vx=vx,
            vy=vy,
            sent_x=sent_x,
            sent_y=sent_y,
            sent_vx=sent_vx,
            sent_vy=sent_vy,
            force=float(mounting.rotate_to_table(reading.force)[2]),
            **dict(zip(JOINT_NAMES, reading.joints.tolist(), strict=True)),
            cycles=self._cycles,
            late=self._late,
            refused=self._refused,
            misalignment=mounting.misalignment(reading.pose),
            speed_scaling=self._motion.scaling,
            braked_at=self.supervisor.braked_at,
            applied_at=self._applied,
        )

    def close(self) -> None:
        """Brake as far as the arm still follows, and report the end."""
        until = self._clock() + 1.0
        while (
            self.supervisor.state is not DriverState.FAULT
            and not self._motion.shaper.at_rest
            and self._clock() < until
        ):
            self._motion.brake()
            self._send(self._clock())
            time.sleep(self._dt)
        self.supervisor.close(self._clock())
        self._publish(self._clock(), self._arm.read())
