"""Safety modes of a controller, with the numbers of its protocol."""

from __future__ import annotations

from enum import IntEnum


class Safety(IntEnum):
    """Safety mode, with its number in the controller's protocol."""

    NORMAL = 1
    PROTECTIVE_STOP = 3
    ROBOT_EMERGENCY_STOP = 7


SAFETY_BITS = {
    Safety.NORMAL: 1 << 0,
    Safety.PROTECTIVE_STOP: 1 << 2,
    Safety.ROBOT_EMERGENCY_STOP: (1 << 6) | (1 << 7),
}
"""Bits of ``safety_status_bits``."""
