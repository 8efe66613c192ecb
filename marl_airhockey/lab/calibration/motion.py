"""Motion: the arm led along a path, and what it was sent and reported meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from marl_airhockey.devices.robot import DriverState, Robot
from marl_airhockey.types import Array

PULL = 2.0
"""Rate with which a paddle that has drifted goes back to its path, 1/s"""
PERIOD = 0.004
"""Time between two commands, s: half of the driver's own"""


class Motion(NamedTuple):
    """Motion of the arm; times are of the monotonic clock."""

    reported: Array
    """(n, 3) time, s, and place, m, as the arm told"""
    sent: Array
    """(m, 3) time, s, and place, m, to which it was sent"""


def lead(
    robot: Robot,
    home: Array,
    path: Callable[[float], tuple[Array, Array]],
    seconds: float,
    tell: Callable[[float], None] = lambda now: None,
) -> Motion:
    """Lead the arm along a path about a place.

    Args:
        robot: that is connected.
        home: (2,) m.
        path: place from there (2,), m, and velocity (2,), m/s, by the time since the
            beginning, s.
        seconds: length.
        tell: called with the time since the beginning, s.

    Raises:
        RuntimeError: the arm stops.
    """
    reported: list[Array] = []
    sent: list[tuple[float, float, float]] = []
    robot.enable()
    began = time.monotonic()
    while (now := time.monotonic() - began) < seconds:
        place, velocity = path(now)
        status = robot.get_observation()
        # It stays about its path whatever commands come late.
        drift = home + place - (status.sent_x, status.sent_y)
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
    return Motion(_in_order(np.concatenate(reported)), _in_order(np.array(sent)))


def _in_order(rows: Array) -> Array:
    """Return rows by their times, each time once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return np.asarray(rows[first])
