"""States of the robot client, and all reasons to leave them.

    READY    at rest; commands are ignored until the caller enables the robot
    RUNNING  enabled: the paddle moves as commanded, pressed on the table
    HOLD     enabled, and braked or braking, because a condition is not met
    FAULT    the arm does not follow; a person has to inspect it

Outside RUNNING the paddle brakes in the plane. Once it rests there, the arm is also
stiff along the table's normal.

A HOLD ends when the condition is met again. A HOLD with a reason in `LATCHED` ends only
when the caller disables the robot. A FAULT ends only by `recovered`, which requires the
confirmation of an operator.
"""

from __future__ import annotations

import logging
from typing import NamedTuple

from marl_airhockey.hardware.robot.arm import ArmFault, Reading
from marl_airhockey.hardware.robot.mailbox import (
    DriverState,
    Fault,
    Request,
    StateChange,
)

STALE = 0.15
"""Age of a command beyond which the paddle brakes, s."""
SILENT = 0.06
"""Time without data from the robot after which it is a fault, s."""
SILENT_AT_REST = 1.0
"""Time without data after which it is a fault for a robot that rests and is not
enabled, s; a computer that opens a web page may be busy for a moment."""
LIFTED = 0.003
"""Distance from the table's plane beyond which a paddle is on a puck or a rail, or
below the table, m."""
AWAY = 0.05
"""Distance from the workspace, and height above the table's plane, beyond which an arm
is not at the table, m."""
OFF_TABLE = 0.02
"""Distance from the table's plane beyond which a paddle has left the table, m."""
PRESSED = 1.0
"""Longest time until a pressed paddle is down on the table, s."""
LATE, LATE_TIME = 0.7, 0.2
"""Share of the largest deviation, and time for which an arm may exceed it, s."""
LATCHED = (Fault.PADDLE_LIFTED, Fault.PADDLE_BELOW_TABLE, Fault.DEVIATION)
"""Reasons of a HOLD that ends only when the caller disables the robot."""
log = logging.getLogger("marl_airhockey.robot")


class Readings(NamedTuple):
    """Quantities that a supervisor checks in a cycle."""

    height: float
    """Height of the paddle above the table's plane, m."""
    deviation: float
    """Distance of the paddle from its expected position, m."""
    moving: bool
    """True if the sent position of the paddle moves."""


class Supervisor:
    """Supervisor of one robot client.

    Args:
        now: Present time, monotonic clock, s.
        stamp: Present time, robot's clock, s.
        deviation: Largest distance of an arm from its expected position, m.
    """

    def __init__(self, now: float, stamp: float, deviation: float) -> None:
        self._deviation = deviation
        self.state, self.fault = DriverState.READY, Fault.NONE
        self.transitions = [StateChange(now, self.state, self.fault)]
        """Changes of the state, the newest last."""
        self.pressed_at = 0.0
        """Time at which the paddle was pressed on the table; 0 while it is not."""
        self.braked_at = 0.0
        """Time at which braking began last."""
        self._stamp, self._heard = stamp, now
        self._late_since = now
        self._must_let_go = False

    def _change(self, now: float, state: DriverState, fault: Fault) -> None:
        if (state, fault) == (self.state, self.fault):
            return
        if self.state is DriverState.RUNNING:
            self.braked_at = now
        self.state, self.fault = state, fault
        self.transitions.append(StateChange(now, state, fault))
        level = logging.WARNING if state is DriverState.FAULT else logging.INFO
        log.log(level, "robot: %s: %s", state.name, fault.label)

    def fail(self, now: float, fault: Fault) -> None:
        """Enter FAULT."""
        self._change(now, DriverState.FAULT, fault)
        self.pressed_at = 0.0

    def hold(self, now: float, fault: Fault) -> None:
        """Enter HOLD, unless the state is FAULT."""
        if self.state is not DriverState.FAULT:
            self._change(now, DriverState.HOLD, fault)
            self._must_let_go |= fault in LATCHED

    def silent(self, now: float) -> bool:
        """Return True if the robot has sent no data for too long."""
        return now - self._heard > SILENT

    def watch_arm(self, now: float, reading: Reading, measured: Readings) -> None:
        """Enter FAULT if the arm is silent or has stopped."""
        if reading.stamp != self._stamp:
            self._stamp, self._heard = reading.stamp, now
        if self.state is DriverState.FAULT:
            self._learn_why(now, reading)
            return
        at_rest = self.state is DriverState.READY and not measured.moving
        if now - self._heard > (SILENT_AT_REST if at_rest else SILENT):
            self.fail(now, Fault.ROBOT_SILENT)
        elif reading.fault is not ArmFault.NONE:
            self.fail(now, Fault(reading.fault))
        elif not self._near_table(now, measured.height):
            self.fail(now, Fault.PADDLE_OFF_TABLE)

    def _is_down(self, now: float) -> bool:
        """Return True if the paddle must have come down on the table."""
        return bool(self.pressed_at) and now - self.pressed_at > PRESSED

    def _is_late(self, now: float, deviation: float) -> bool:
        """Return True if an arm is too late, or late for too long while it runs."""
        runs = self.state is DriverState.RUNNING
        if not runs or deviation < LATE * self._deviation:
            self._late_since = now
        return deviation > self._deviation or now - self._late_since > LATE_TIME

    def _near_table(self, now: float, height: float) -> bool:
        above = OFF_TABLE if self._is_down(now) else AWAY + OFF_TABLE
        return -OFF_TABLE <= height <= above

    def _learn_why(self, now: float, reading: Reading) -> None:
        """Update the reason of a stop, which may arrive after its effect."""
        lost = self.fault is Fault.PROGRAM_LOST and reading.fault is not ArmFault.NONE
        if lost or reading.fault is ArmFault.EMERGENCY_STOP:
            self.fail(now, Fault(reading.fault))

    def watch_request(self, now: float, request: Request, measured: Readings) -> None:
        """Enter READY, RUNNING or HOLD, depending on the caller's request."""
        if self.state is DriverState.FAULT:
            return
        if not request.enabled:
            self._must_let_go = False
            self._change(now, DriverState.READY, Fault.NONE)
        elif self._must_let_go:
            pass
        elif measured.height < -LIFTED:
            self.hold(now, Fault.PADDLE_BELOW_TABLE)
        elif self._is_down(now) and measured.height > LIFTED:
            self.hold(now, Fault.PADDLE_LIFTED)
        elif self._is_late(now, measured.deviation):
            self.hold(now, Fault.DEVIATION)
        elif not now - request.stamp <= STALE:
            self.hold(now, Fault.COMMAND_STALE)
        else:
            self._change(now, DriverState.RUNNING, Fault.NONE)

    def recovered(self, now: float, enabled: bool) -> None:
        """Leave FAULT; a caller that still enables the robot must first disable it."""
        self._must_let_go, self._heard = enabled, now
        self._change(now, DriverState.READY, Fault.NONE)

    def close(self, now: float) -> None:
        """Enter CLOSED."""
        self._change(now, DriverState.CLOSED, self.fault)
