"""Nominal mounting of the emulated arm at its table."""

from __future__ import annotations

import numpy as np

from marl_airhockey.hardware.robot.kinematics import vector_of
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.sim.contracts.camera_model import BEHIND
from marl_airhockey.sim.core.seat import Seat, make_seat
from marl_airhockey.sim.core.table import TABLES, Table

BELOW = 0.02
"""Height of the table's edge above the base, m."""
TILT = 5.5
"""Tilt of the table, deg."""


def nominal_mounting(table: Table, tilt: float = TILT) -> Mounting:
    """Return the pose of a table in the base frame of the arm at its home side.

    Args:
        table: Table. The home edge is the same for all tables.
        tilt: Tilt of the table, deg.
    """
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    rotation = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    edge = np.array([BEHIND, 0.0, BELOW])
    origin = edge + rotation @ (table.offsets[0], 0.0, 0.0)
    # The tool's z points into the table, its x along it.
    foot = np.column_stack([rotation[:, 0], -rotation[:, 1], -rotation[:, 2]])
    return Mounting.of(origin, rotation, vector_of(foot))


def table_of(seat: Seat) -> Table:
    """Return the preset table whose robot seat has the workspace of a seat.

    Raises:
        ValueError: There is none, as the seat is not that of a robot.
    """
    for table in TABLES.values():
        if make_seat("robot", table, 0).reach == seat.reach:
            return table
    raise ValueError(
        "ur5e: this is not the seat of a robot; choose a task with one agent, or a "
        "game with --option seats=robot"
    )
