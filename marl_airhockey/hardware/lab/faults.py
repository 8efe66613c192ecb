"""Faults of the lab, which can be switched on and off."""

from __future__ import annotations

from marl_airhockey.hardware.ur_emulator.faults import FAULTS as CONTROLLER_FAULTS

ARM_FAULTS = {name: fault.what for name, fault in CONTROLLER_FAULTS.items()}
TABLE_FAULTS = {
    "frozen_camera": "the camera sends no more frames",
    "dark_camera": "the lights are off",
    "moved_camera": "the camera is moved by 2 cm",
    "delayed_frames": "frames arrive 0.2 s late",
    "second_puck": "a second puck lies on the table",
    "repeated_frames": "the camera sends every frame twice",
    "stuck_frame": "the camera sends the same frame again and again",
    "lost_puck": "the puck is not on the table",
}
FAULTS = {**ARM_FAULTS, **TABLE_FAULTS}
"""Descriptions of the faults, by name."""
