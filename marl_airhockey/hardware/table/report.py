"""Report of the devices of a table, which recordings and pages show."""

from __future__ import annotations

import time
from typing import Any

from marl_airhockey.hardware.table.devices import TableDevices
from marl_airhockey.hardware.table.tracker import Tracker
from marl_airhockey.hardware.table.troubles import robot_trouble


def device_report(devices: TableDevices, tracker: Tracker) -> dict[str, Any]:
    """Return the state of robot, camera and tracker as JSON values."""
    robot, camera, last = devices.robot, devices.camera, tracker.last
    status = robot.get_observation()
    return {
        "applied": status.applied_at,
        "robot": robot.state.name,
        "fault": robot.fault.label,
        "trouble": robot_trouble(robot),
        "sent": [round(status.sent_vx, 4), round(status.sent_vy, 4)],
        "sent_position": [round(status.sent_x, 4), round(status.sent_y, 4)],
        "height_mm": round(1e3 * status.z, 2),
        "force": round(status.force, 1),
        "joints": [round(angle, 5) for angle in status.joints],
        "cycles": int(status.cycles),
        "late": int(status.late),
        "refused": int(status.refused),
        "camera": camera.trouble,
        "frame_ms": round(1e3 * min(camera.age, 99.0), 1),
        "dropped": camera.dropped,
        "puck_ms": round(1e3 * (time.monotonic() - last.time), 1) if last else None,
        "noise_mm": round(1e3 * tracker.noise, 2),
    }
