"""Faults: what goes wrong in the lab on demand."""

from __future__ import annotations

ARM_FAULTS = {
    "protective_stop": "the arm stops as after a collision",
    "emergency_stop": "somebody presses the red button",
    "silent_robot": "the controller sends nothing more",
    "delayed_packets": "what the controller sends comes 0.1 s late",
    "puck_under_paddle": "the paddle is lifted by 6 mm",
}
TABLE_FAULTS = {
    "frozen_camera": "no more frames come",
    "dark_camera": "the lights are off",
    "moved_camera": "somebody has knocked against the camera",
    "lost_puck": "the puck is not on the table",
}
FAULTS = {**ARM_FAULTS, **TABLE_FAULTS}
"""Faults by name, in words"""
