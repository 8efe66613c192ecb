"""Driver: the process between commands and an arm, 125 times a second.

It takes wanted velocities from a mailbox and sends the arm shaped places. It brakes
when a command is older than `STALE`, when its caller is gone, when the paddle leaves
the table's plane, and when it is late itself; it stops for good when the arm is silent
or has stopped. It never recovers by itself, and never from an emergency stop.
"""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from marl_airhockey.devices.priority import raise_priority
from marl_airhockey.devices.robot.arm import Arm, ArmFault, Reading
from marl_airhockey.devices.robot.mailbox import (
    JOINT_NAMES,
    TRACK,
    DriverState,
    Fault,
    Mailbox,
    Status,
)
from marl_airhockey.devices.robot.mounting import Mounting
from marl_airhockey.devices.robot.shaper import MotionLimits, Shaper
from marl_airhockey.types import Array

RATE = 125.0
"""Cycles a second"""
STALE = 0.15
"""Age of a command beyond which the paddle brakes, s"""
SILENT = 0.06
"""Time without news from a robot that moves that is a fault, s"""
SILENT_AT_REST = 1.0
"""The same of a robot at rest that nobody holds enabled, s: a machine that opens a page
may be busy for a moment"""
OVERRUN = 0.1
"""Delay of a cycle after which the paddle brakes, s"""
LIFTED = 0.003
"""Distance from the table's plane at which a paddle is on a puck or a rail, m"""
PRESSED = 1.0
"""Time for which a paddle may take to come down on the table after it was pressed, s"""
PRESS = 5.0
"""Force with which a paddle is pressed on the table, N"""


@dataclass(frozen=True)
class DriverConfig:
    """What a driver has to know."""

    host: str
    mounting: Mounting
    reach: tuple[tuple[float, float], ...]
    """Polygon of the paddle's centre, table frame, m"""
    limits: MotionLimits = field(default_factory=MotionLimits)
    tool: tuple[float, ...] = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
    """Pose of the paddle's foot in the flange's frame, m and rad"""
    payload: float = 0.6
    """Mass of the paddle and what holds it, kg"""
    smoothing: float = 0.0
    """Time constant by which commands are smoothed before they are shaped, s"""


def run_driver(config: DriverConfig, memory: Any) -> None:
    """Run until the mailbox says closing, or the parent process is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise_priority()
    parent, box = os.getppid(), Mailbox(memory)
    from marl_airhockey.devices.robot.ur5e import Ur5e

    try:
        arm = Ur5e(config.host, np.array(config.tool), config.payload)
    except Exception:
        blank = [0.0] * len(Status._fields)
        blank[:2] = float(DriverState.FAULT), float(Fault.NOT_CONNECTED)
        box.status = Status(*blank)  # type: ignore[arg-type]
        raise
    driver = Driver(config, arm, box)
    try:
        while not box.wanted.closing and os.getppid() == parent:
            driver.cycle()
            driver.wait()
        driver.come_to_rest()
    finally:
        arm.close()


class Driver:
    """Driver of one arm.

    Args:
        config: of the driver.
        arm: that it moves.
        box: where commands come from and the state goes to.
    """

    def __init__(self, config: DriverConfig, arm: Arm, box: Mailbox) -> None:
        self._config, self._arm, self._box = config, arm, box
        self._dt = 1.0 / RATE
        self.state, self.fault = DriverState.READY, Fault.NONE
        self._pressed_at = 0.0
        self._cycles = self._late = self._refused = 0
        self._braked_at = 0.0
        self._recovered, self._seen = box.wanted.recover, 0.0
        self._held = False
        self._due = time.monotonic()
        self._smooth = np.zeros(2)
        reading = arm.read()
        self._stamp, self._heard = reading.stamp, time.monotonic()
        self._track = np.zeros((TRACK, 3))
        self._track[:] = self._due, *self._place(reading)
        self._shaper = self._shaper_at(reading)

    def _place(self, reading: Reading) -> Array:
        return self._config.mounting.to_table(reading.pose)[:2]

    def _shaper_at(self, reading: Reading) -> Shaper:
        config = self._config
        reach = np.array(config.reach)
        return Shaper(config.limits, reach, self._dt, self._place(reading))

    def wait(self) -> None:
        """Wait for the next cycle."""
        self._due += self._dt
        left = self._due - time.monotonic()
        if left > 0:
            time.sleep(left)
            return
        if left < -0.5 * self._dt:
            # What was missed is not made up for: poses in a hurry are a leap.
            self._late += 1
            self._due = time.monotonic()
        if left < -OVERRUN:
            self._hold(Fault.DRIVER_LATE)

    def cycle(self) -> None:
        """Read the arm, decide, move the paddle on, and tell."""
        now, reading = time.monotonic(), self._arm.read()
        if reading.stamp != self._stamp:
            self._stamp, self._heard = reading.stamp, now
        wanted = self._box.wanted
        if self.state is not DriverState.FAULT:
            self._check(now, reading)
        if self.state is DriverState.FAULT:
            self._learn_why(reading)
            if wanted.recover > self._recovered:
                self._recovered = wanted.recover
                self._recover(now)
                # That takes half a second.
                now, reading = time.monotonic(), self._arm.read()
        else:
            self._move(now, reading)
        self._cycles += 1
        self._tell(now, reading)

    def _check(self, now: float, reading: Reading) -> None:
        at_rest = self.state is DriverState.READY and not np.any(self._shaper.velocity)
        if now - self._heard > (SILENT_AT_REST if at_rest else SILENT):
            self._fail(Fault.ROBOT_SILENT)
        elif reading.fault is not ArmFault.NONE:
            self._fail(Fault(reading.fault))

    def _learn_why(self, reading: Reading) -> None:
        """Take the reason of a stop, which may arrive after its effect."""
        lost = self.fault is Fault.PROGRAM_LOST and reading.fault is not ArmFault.NONE
        if lost or reading.fault is ArmFault.EMERGENCY_STOP:
            self.fault = Fault(reading.fault)

    def _fail(self, fault: Fault) -> None:
        self.state, self.fault = DriverState.FAULT, fault
        self._braked_at, self._pressed_at = time.monotonic(), 0.0

    def _hold(self, fault: Fault) -> None:
        if self.state is DriverState.RUNNING:
            self._braked_at = time.monotonic()
        if self.state is not DriverState.FAULT:
            self.state, self.fault = DriverState.HOLD, fault

    def _move(self, now: float, reading: Reading) -> None:
        wanted = self._box.wanted
        velocity = np.array([wanted.vx, wanted.vy])
        height = self._config.mounting.to_table(reading.pose)[2]
        down = self._pressed_at and now - self._pressed_at > PRESSED
        if not wanted.enabled:
            if self.state is DriverState.RUNNING:
                self._braked_at = now
            # Who lets go ends what held the paddle.
            self.state, self.fault, self._held = DriverState.READY, Fault.NONE, False
        elif self._held:
            pass
        elif down and abs(height) > LIFTED:
            self._hold(Fault.PADDLE_LIFTED)
            self._held = True
        elif now - wanted.stamp > STALE:
            self._hold(Fault.COMMAND_STALE)
        else:
            self.state, self.fault = DriverState.RUNNING, Fault.NONE
        if self.state is DriverState.RUNNING:
            if wanted.stamp != self._seen:
                self._seen = wanted.stamp
                self._refused += not np.isfinite(velocity).all()
            if not self._pressed_at:
                self._arm.press(self._config.mounting.frame(), PRESS)
                self._pressed_at = now
            left = wanted.stamp + wanted.seconds - now
            place = self._shaper.step(self._smoothed(velocity), max(left, 0.0))
        else:
            place = self._shaper.brake()
        pose = self._config.mounting.pose(place)
        if not self._arm.follow(pose, self._dt):
            reading = self._arm.read()
            lost = reading.fault is ArmFault.NONE
            self._fail(Fault.PROGRAM_LOST if lost else Fault(reading.fault))

    def _smoothed(self, velocity: Array) -> Array:
        if not self._config.smoothing or not np.isfinite(velocity).all():
            return velocity
        share = self._dt / (self._config.smoothing + self._dt)
        self._smooth = self._smooth + share * (velocity - self._smooth)
        return self._smooth

    def _recover(self, now: float) -> None:
        """Go on after a stop, as an operator has asked; never after an emergency."""
        fault = self._arm.read().fault
        if self.fault is Fault.EMERGENCY_STOP or fault is ArmFault.EMERGENCY_STOP:
            return
        if self.fault is Fault.ROBOT_SILENT or now - self._heard > SILENT:
            # Its client may be beyond repair; the caller starts a new process.
            return
        if self._arm.unlock():
            return
        reading = self._arm.read()
        # Whoever still holds it enabled has to let go first.
        self._shaper = self._shaper_at(reading)
        self._held = bool(self._box.wanted.enabled)
        self._heard = self._due = time.monotonic()
        self.state, self.fault = DriverState.READY, Fault.NONE

    def _tell(self, now: float, reading: Reading) -> None:
        mounting = self._config.mounting
        place = mounting.to_table(reading.pose)
        velocity = mounting.rotate_to_table(reading.velocity)
        self._track[:-1] = self._track[1:]
        self._track[-1] = now, *place[:2]
        self._box.track = self._track
        shaper = self._shaper
        x, y, z = place.tolist()
        vx, vy, _ = velocity.tolist()
        sent_x, sent_y = shaper.place.tolist()
        sent_vx, sent_vy = shaper.velocity.tolist()
        self._box.status = Status(
            state=self.state,
            fault=self.fault,
            stamp=now,
            x=x,
            y=y,
            z=z,
            vx=vx,
            vy=vy,
            sent_x=sent_x,
            sent_y=sent_y,
            sent_vx=sent_vx,
            sent_vy=sent_vy,
            force=float(reading.force[2]),
            **dict(zip(JOINT_NAMES, reading.joints.tolist(), strict=True)),
            cycles=self._cycles,
            late=self._late,
            refused=self._refused,
            braked_at=self._braked_at,
        )

    def come_to_rest(self) -> None:
        """Brake, as far as the arm still follows, and say that the driver ends."""
        until = time.monotonic() + 1.0
        while self.state is not DriverState.FAULT and time.monotonic() < until:
            place = self._shaper.brake()
            pose = self._config.mounting.pose(place)
            if not np.any(self._shaper.velocity) or not self._arm.follow(
                pose, self._dt
            ):
                break
            time.sleep(self._dt)
        self.state = DriverState.CLOSED
        self._tell(time.monotonic(), self._arm.read())
