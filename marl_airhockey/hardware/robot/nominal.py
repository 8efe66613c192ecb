"""Nominal mounting: how the arm of the emulator stands at its table."""

from __future__ import annotations

import numpy as np

from marl_airhockey.hardware.robot.kinematics import vector_of
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.sim.core.seat import Seat, make_seat
from marl_airhockey.sim.core.table import TABLES, Table

BEHIND = 0.22
"""Distance of the arm's base from the table's edge, m"""
BELOW = 0.02
"""Height of that edge above the base, m"""
TILT = 5.5
"""Tilt of the table, deg"""


def nominal_mounting(table: Table, tilt: float = TILT) -> Mounting:
    """Return where a table lies in the base frame of the arm at its home side.

    Args:
        table: Table; all of them share the home edge.
        tilt: Its tilt, deg.
    """
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    rotation = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    edge = np.array([BEHIND, 0.0, BELOW])
    origin = edge + rotation @ (table.offsets[0], 0.0, 0.0)
    # The tool's z points into the table, its x along it.
    foot = np.column_stack([rotation[:, 0], -rotation[:, 1], -rotation[:, 2]])
    return Mounting.of(origin, rotation, vector_of(foot))


def table_of(seat: Seat) -> Table:
    """Return the preset table whose robot seat has the reach of a seat.

    Raises:
        ValueError: There is none: the seat is no robot's.
    """
    for table in TABLES.values():
        if make_seat("robot", table, 0).reach == seat.reach:
            return table
    raise ValueError(
        "ur5e: this seat is no robot's; play a single-agent task, or a game with "
        "--option seats=robot"
    )
