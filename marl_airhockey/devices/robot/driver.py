"""Driver: the process between commands and an arm, 125 times a second.

It takes commanded velocities from a mailbox and sends the arm shaped poses. It brakes
when a command is older than 0.15 s, when its caller is gone, when the paddle leaves the
table's plane or does not follow, and when it is late itself; it stops for good when the
arm is silent or has stopped (`supervisor.Supervisor`). It never recovers without an
operator's word, and never from an emergency stop.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from marl_airhockey.core.geometry import half_planes
from marl_airhockey.devices.priority import raise_priority
from marl_airhockey.devices.robot.arm import Arm, ArmFault, Reading
from marl_airhockey.devices.robot.config import DriverConfig
from marl_airhockey.devices.robot.mailbox import (
    JOINT_NAMES,
    TRACK,
    DriverState,
    Fault,
    Mailbox,
    RobotObservation,
)
from marl_airhockey.devices.robot.shaper import Shaper
from marl_airhockey.devices.robot.supervisor import LIFTED, Measured, Supervisor
from marl_airhockey.types import Array

RATE = 125.0
"""Cycles a second"""
OVERRUN = 0.1
"""Delay of a cycle after which the paddle brakes, s"""
MARGIN = 0.001
"""Distance from the edge of the reach at which what is sent ends, m: the lag of the
joints bends a path by less"""
NEW_PROCESS = (Fault.ROBOT_SILENT, Fault.CONNECTION_LOST)
"""Faults after which a driver must be started again"""
AWAY = 0.05
"""Distance from the reach, and from the table's plane, at which an arm is somewhere
else than at the table, m"""


def run_driver(config: DriverConfig, memory: Any) -> None:
    """Run until the mailbox says closing, or the parent process is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise_priority()
    parent, box = os.getppid(), Mailbox(memory)
    from marl_airhockey.devices.robot.ur5e import Ur5e

    try:
        arm = Ur5e(config)
    except Exception:
        box.observation = RobotObservation.of_fault(Fault.NOT_CONNECTED)
        raise
    driver = Driver(config, arm, box)
    try:
        while not box.request.closing and os.getppid() == parent:
            driver.cycle()
            driver.wait()
        driver.come_to_rest()
    finally:
        arm.close()
        if driver.supervisor.fault in NEW_PROCESS:
            # The client's threads would abort the process in their own way.
            os._exit(1)


class Driver:
    """Driver of one arm.

    Args:
        config: Configuration.
        arm: Arm that it moves.
        box: Mailbox of requests and observations.
        clock: Function that returns the time, s; another one emulates time.
    """

    def __init__(
        self,
        config: DriverConfig,
        arm: Arm,
        box: Mailbox,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config, self._arm, self._box, self._clock = config, arm, box, clock
        self._dt = 1.0 / RATE
        self._cycles = self._late = self._refused = self._logged = 0
        self._recovered, self._seen = box.request.recover, 0.0
        self._due = clock()
        self._filter = config.smoothing.make(self._dt)
        reading = arm.read()
        self.supervisor = Supervisor(self._due, reading.stamp, config.servo.deviation)
        self._track = np.zeros((TRACK, 3))
        self._track[:] = self._due, *self._position(reading)[:2]
        self._shaper = self._shaper_at(reading)
        if not self._at_table(reading):
            self.supervisor.fail(self._due, Fault.NOT_AT_TABLE)
        elif reading.fault is ArmFault.NONE and self._position(reading)[2] > LIFTED:
            # Only in free air: on the table the contact's force would count as none.
            arm.zero_force_sensor()

    def _position(self, reading: Reading) -> Array:
        """Return (3,) the paddle, table frame, m."""
        return self._config.mounting.to_table(reading.pose)

    def _at_table(self, reading: Reading) -> bool:
        """Return True if the paddle is over the reach or on it."""
        *place, height = self._position(reading)
        corners = tuple((float(x), float(y)) for x, y in self._config.reach)
        normals, offsets = half_planes(corners)
        outside = -float((normals @ place + offsets).min())
        return outside < AWAY and abs(height) < AWAY

    def _shaper_at(self, reading: Reading) -> Shaper:
        config = self._config
        reach, place = np.array(config.reach), self._position(reading)[:2]
        self._filter.reset(np.zeros(2))
        return Shaper(config.limits, reach, self._dt, place, MARGIN)

    def wait(self) -> None:
        """Wait for the next cycle."""
        self._due += self._dt
        left = self._due - self._clock()
        if left > 0:
            time.sleep(left)
            return
        if left < -0.5 * self._dt:
            # What was missed is not made up for: poses in a hurry are a leap.
            self._late += 1
            self._due = self._clock()
        if left < -OVERRUN:
            self.supervisor.hold(self._clock(), Fault.DRIVER_LATE)

    def cycle(self) -> None:
        """Read the arm, decide, move the paddle, and publish an observation."""
        now, reading = self._clock(), self._arm.read()
        request, supervisor = self._box.request, self.supervisor
        position = self._position(reading)
        measured = Measured(
            float(position[2]),
            float(np.linalg.norm(position[:2] - self._shaper.place)),
            bool(np.any(self._shaper.velocity)),
        )
        supervisor.watch_arm(now, reading, measured)
        supervisor.watch_request(now, request, measured)
        if supervisor.state is not DriverState.FAULT:
            self._move(now)
        elif request.recover > self._recovered:
            self._recovered = request.recover
            self._recover(now)
            # That takes half a second.
            now, reading = self._clock(), self._arm.read()
        elif supervisor.fault is Fault.ROBOT_SILENT and measured.moving:
            # It may still hear: braking is better than a pose that stands still.
            self._send(now, self._shaper.brake())
        self._cycles += 1
        self._publish(now, reading)

    def _move(self, now: float) -> None:
        request, supervisor = self._box.request, self.supervisor
        if supervisor.state is not DriverState.RUNNING:
            self._send(now, self._shaper.brake())
            self._filter.reset(self._shaper.velocity)
            return
        velocity = np.array([request.vx, request.vy])
        finite = bool(np.isfinite(velocity).all())
        if request.stamp != self._seen:
            self._seen = request.stamp
            self._refused += not finite
        if not supervisor.pressed_at:
            self._arm.press(self._config.mounting.frame(), self._config.servo.force)
            supervisor.pressed_at = now
        if not finite:
            self._send(now, self._shaper.brake())
            self._filter.reset(self._shaper.velocity)
            return
        left = max(request.stamp + request.seconds - now, 0.0)
        self._send(now, self._shaper.step(*self._filter.step(velocity, left)))

    def _send(self, now: float, place: Array) -> None:
        pose = self._config.mounting.pose(place)
        if self._arm.follow(pose, self._dt):
            return
        if self.supervisor.state is not DriverState.FAULT:
            fault = self._arm.read().fault
            lost = fault is ArmFault.NONE
            self.supervisor.fail(now, Fault.PROGRAM_LOST if lost else Fault(fault))

    def _recover(self, now: float) -> None:
        """Recover from a stop, on an operator's word; never from an emergency stop."""
        fault, reading = self.supervisor.fault, self._arm.read()
        emergency = reading.fault is ArmFault.EMERGENCY_STOP
        if emergency or fault is Fault.EMERGENCY_STOP:
            return
        if fault in NEW_PROCESS or self.supervisor.silent(now):
            # Its client may be beyond repair; the caller starts a new process.
            return
        stopped = reading.fault is not ArmFault.NONE
        if not self._at_table(reading) or (stopped and self._arm.unlock()):
            return
        self._shaper = self._shaper_at(self._arm.read())
        self._due = self._clock()
        self.supervisor.recovered(self._due, bool(self._box.request.enabled))

    def _publish(self, now: float, reading: Reading) -> None:
        mounting, shaper = self._config.mounting, self._shaper
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
            braked_at=self.supervisor.braked_at,
        )

    def come_to_rest(self) -> None:
        """Brake, as far as the arm still follows, and report that the driver ends."""
        until = self._clock() + 1.0
        while (
            self.supervisor.state is not DriverState.FAULT
            and np.any(self._shaper.velocity)
            and self._clock() < until
        ):
            self._send(self._clock(), self._shaper.brake())
            time.sleep(self._dt)
        self.supervisor.close(self._clock())
        self._publish(self._clock(), self._arm.read())
