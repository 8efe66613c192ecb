"""Faults of the lab, which can be switched on and off."""

from __future__ import annotations

from marl_airhockey.lab.ur_controller.faults import FAULTS as CONTROLLER_FAULTS

ARM_FAULTS = {name: fault.what for name, fault in CONTROLLER_FAULTS.items()}
TABLE_FAULTS = {
    "frozen_camera": "no more frames come",
    "dark_camera": "the lights are off",
    "moved_camera": "somebody has knocked against the camera",
    "delayed_frames": "frames come 0.2 s late",
    "second_puck": "somebody has left a second puck on the table",
    "lost_puck": "the puck is not on the table",
}
FAULTS = {**ARM_FAULTS, **TABLE_FAULTS}
"""Descriptions of the faults, by name"""
