"""Reasons why an episode on a real table cannot continue."""

from __future__ import annotations

from marl_airhockey.hardware.robot import DriverState, Robot
from marl_airhockey.hardware.robot.supervisor import LATCHED
from marl_airhockey.hardware.table.devices import TableDevices
from marl_airhockey.hardware.table.tracker import Tracker

BLIND = 0.3
"""Time without a camera frame after which an episode ends, s."""
DELAYED = 0.15
"""Time from an exposure until its frame arrives after which an episode ends, s."""
LOST = 2.0
"""Time for which a puck may be unseen, s."""


def trouble_of(devices: TableDevices, tracker: Tracker, now: float) -> str:
    """Return the reason why an episode cannot continue; "" if it can."""
    robot = robot_trouble(devices.robot)
    return robot or (_blindness(devices, tracker, now) if devices.pucks else "")


def robot_trouble(robot: Robot) -> str:
    """Return the reason why the robot does not follow commands; "" if it does."""
    # A HOLD because commands were late ends with the next command.
    held = robot.state is DriverState.HOLD and robot.fault in LATCHED
    if held or robot.state is DriverState.FAULT:
        return f"robot: {robot.fault.label}"
    return "" if robot.is_connected else "robot: its driver has ended"


def _blindness(devices: TableDevices, tracker: Tracker, now: float) -> str:
    """Return the reason why the puck's state is not known; "" if it is."""
    camera, last = devices.camera, tracker.last
    if camera.age > BLIND:
        return camera.trouble
    if camera.transit > DELAYED:
        return f"camera: frames arrive {camera.transit:.2f} s after their exposure"
    if devices.watcher.trouble:
        return devices.watcher.trouble
    if last is not None and now - last.time > LOST:
        return f"puck: not seen for {LOST:.0f} s"
    return tracker.innovations.trouble
