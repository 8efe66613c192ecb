"""Motion of the arm along a path, with a record of sent and reported positions."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from marl_airhockey.hardware.robot import DriverState, Robot
from marl_airhockey.types import Array

PULL = 2.0
"""Gain of the feedback that brings a drifted paddle back to its path, 1/s."""
PERIOD = 0.004
"""Time between two commands, s: half of the robot client's period."""


class RecordedMotion(NamedTuple):
    """Motion of the arm; times are of the monotonic clock."""

    reported: Array
    """Times, s, and positions, m, that the arm reported (n, 3)."""
    sent: Array
    """Times, s, and positions, m, that were sent to the arm (m, 3)."""


def lead(
    robot: Robot,
    home: Array,
    path: Callable[[float], tuple[Array, Array]],
    seconds: float,
    tell: Callable[[float], None] = lambda now: None,
) -> RecordedMotion:
    """Move the arm along a path and return the motion.

    Args:
        robot: Connected robot.
        home: Origin (2,) of the path, table frame, m.
        path: Function of the time since the start, s, that returns the offset (2,) from
            home, m, and the velocity (2,), m/s.
        seconds: Length of the motion, s.
        tell: Function that is called with the time since the start, s.

    Raises:
        RuntimeError: The arm stops.
    """
    reported: list[Array] = []
    sent: list[tuple[float, float, float]] = []
    robot.enable()
    began = time.monotonic()
    while (now := time.monotonic() - began) < seconds:
        offset, velocity = path(now)
        status = robot.get_observation()
        # The feedback keeps the arm near its path if commands are late.
        drift = home + offset - (status.sent_x, status.sent_y)
        robot.send_action(velocity + PULL * drift, 0.02)
        if (
            robot.state in (DriverState.FAULT, DriverState.HOLD)
            or not robot.is_connected
        ):
            raise RuntimeError(f"robot: {robot.fault.label}")
        reported.append(robot.track[-40:])
        sent.append((status.stamp, status.sent_x, status.sent_y))
        tell(now)
        time.sleep(PERIOD)
    robot.disable()
    return RecordedMotion(
        _in_order(np.concatenate(reported)), _in_order(np.array(sent))
    )


def _in_order(rows: Array) -> Array:
    """Return rows sorted by time, one row for each time."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return np.asarray(rows[first])
