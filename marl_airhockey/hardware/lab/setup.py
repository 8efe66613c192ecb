"""Devices of the virtual lab and their true poses, which are hidden from clients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marl_airhockey.hardware.robot.kinematics import inverse, pose_of
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.hardware.robot.nominal import TILT, nominal_mounting
from marl_airhockey.hardware.ur_emulator.arm import EmulatedArm
from marl_airhockey.hardware.ur_emulator.plant import EmptyTable, Plant
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.seat import Seat, make_seat
from marl_airhockey.sim.core.table import TABLES, Table
from marl_airhockey.types import Array

TOOL = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Pose of the paddle's foot, flange frame, m and rad."""
ELBOW_UP = (2.9, -1.13, 1.94, -2.47, -1.57, 4.48)
"""Initial angles of the search for the start angles, rad. With the elbow up, no joint
is faster than 0.92 pi rad/s at 0.7 m/s anywhere in the workspace. With the elbow down,
the arm is stretched at the far end, and joints are faster."""
LIFT = 0.02
"""Height of the paddle above the table when the lab opens, m."""


@dataclass(frozen=True)
class LabSetup:
    """Setup of a lab: one table with an arm at its home side."""

    table: str = "full_size"
    """Name of the table's preset."""
    tilt: float = TILT
    """Tilt of the table, deg."""
    plant: str = "numba"
    """Name of the backend that moves puck and paddle."""
    marked: bool = False
    """True for a puck with a mark, see `vision.mark`."""
    block: bool = False
    """True for a block on the table, next to the puck."""
    latency: float = 0.028
    """Time from the middle of an exposure until the frame is sent, s: half of the
    exposure, the readout and the transfer."""

    @cached_property
    def geometry(self) -> Table:
        """Geometry of the table."""
        return TABLES[self.table]

    @cached_property
    def seat(self) -> Seat:
        """Seat of the arm."""
        return make_seat("robot", self.geometry, 0)

    @cached_property
    def home(self) -> Array:
        """Rest position (2,) of the paddle, table frame, m."""
        return np.asarray(np.mean(np.asarray(self.seat.reach), 0))

    @cached_property
    def mounting(self) -> Mounting:
        """True pose of the table in the arm's base frame."""
        return nominal_mounting(self.geometry, self.tilt)

    def make_table(self) -> EmptyTable:
        """Return the table under the paddle, as a plant."""
        normal = np.array(self.mounting.rotation)[:, 2]
        return EmptyTable(np.array(self.mounting.origin), normal)

    def make_arm(self, plant: Plant | None = None) -> EmulatedArm:
        """Return the arm with its paddle above its home position.

        Args:
            plant: Model of what the paddle touches; None for an empty table.

        Raises:
            RuntimeError: scipy is missing. The message contains the command to install
                it.
            ValueError: The arm does not reach its table.
        """
        require("scipy", "hardware")
        pose = pose_of(self.mounting.pose(self.home, LIFT))
        flange = pose @ np.linalg.inv(pose_of(np.array(TOOL)))
        found, angles = inverse(flange, np.array(ELBOW_UP), 200)
        if not found:
            raise ValueError(f"the arm does not reach {self.home} m on {self.table}")
        return EmulatedArm(angles, np.array(TOOL), plant or self.make_table())
