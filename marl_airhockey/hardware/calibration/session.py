"""Calibration of a table's camera, puck and arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.hardware.calibration.camera_session import (
    AVERAGED,
    CameraSession,
    FoundByCamera,
    need,
)
from marl_airhockey.hardware.camera import Camera
from marl_airhockey.hardware.rig import Rig
from marl_airhockey.hardware.robot.mounting import Mounting, fit_mounting
from marl_airhockey.hardware.vision import Colour, Detector
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

TOUCHES = 9
"""Least number of positions at which the paddle touches the table."""
LOOSE = 0.005
"""Largest accepted error of the robot's fit, m."""


@dataclass
class Found(FoundByCamera):
    """Results of a table's calibration so far."""

    puck: Colour | None = None
    block: Colour | None = None
    places: list[Array] = field(default_factory=list)
    """Positions (2,) of the paddle on the table, table frame, m."""
    poses: list[Array] = field(default_factory=list)
    """Poses (6,) of the arm's tool at these positions, base frame, m and rad."""
    mounting: Mounting | None = None


class CalibrationSession(CameraSession):
    """Calibration session of one camera, one table and one arm.

    Args:
        camera: Open camera over the table.
        read_pose: Function that returns the pose (6,) of the arm's tool, base frame, m
            and rad.
        rig: Fields of the `Rig` that are not measured, by name: table, camera, robot.
        path: Path of the rig's file.
        measured: Measured corners (4, 2) of tags by number, table frame, m; None to
            find the view by the table's edges.
    """

    def __init__(
        self,
        camera: Camera,
        read_pose: Callable[[], Array],
        rig: Mapping[str, Any],
        path: Path,
        measured: Mapping[int, Array] | None = None,
    ) -> None:
        self._table = table = TABLES[rig["table"]]
        corners = np.asarray(table.vertices)
        super().__init__(camera, corners, table.paddle_radius, path, measured)
        self._read_pose, self._rig = read_pose, dict(rig)
        self.found: Found = Found()
        self.orders |= {
            "puck": self.click_puck,
            "block": self.click_block,
            "touch": self.touch,
            "robot": self.solve_robot,
        }

    def click_puck(self, x: float, y: float) -> None:
        """Take the puck's colour from a clicked pixel."""
        self.found.puck = Colour.around(self._frame().image, (x, y))

    def click_block(self, x: float, y: float) -> None:
        """Take the block's colour from a clicked pixel."""
        self.found.block = Colour.around(self._frame().image, (x, y))

    def touch(self) -> None:
        """Add the paddle's position, seen by the camera and reported by the arm.

        Raises:
            ValueError: The paddle is not seen, or the arm moves.
        """
        detector = self._paddle_detector()
        before = np.asarray(self._read_pose())
        sightings = [detector.find(frame) for frame in self._frames(AVERAGED)]
        after = np.asarray(self._read_pose())
        positions = [seen.place for seen in sightings if seen is not None]
        if len(positions) < AVERAGED // 2:
            raise ValueError(
                "the paddle is not seen at this position; move it where less is hidden"
            )
        if np.linalg.norm(after[:3] - before[:3]) > 0.0005:
            raise ValueError(
                "the arm moves; wait until it rests, then take the position"
            )
        self.found.places.append(np.median(positions, axis=0))
        self.found.poses.append(after)

    def solve_robot(self) -> None:
        """Find the table's pose in the arm's base frame.

        Raises:
            ValueError: There are too few positions, or no pose fits them.
        """
        found = self.found
        if len(found.places) < TOUCHES:
            raise ValueError(
                f"{len(found.places)} positions; put the paddle on the table at "
                f"{TOUCHES} or more, all over its workspace"
            )
        poses = np.array(found.poses)
        mounting = fit_mounting(
            np.array(found.places), poses[:, :3], np.median(poses[:, 3:], axis=0)
        )
        if mounting.residual > LOOSE:
            raise ValueError(
                f"the positions fit to {1e3 * mounting.residual:.1f} mm, "
                f"{1e3 * LOOSE:.0f} mm is allowed; put the paddle flat on the table, "
                "and set the tool's centre to its foot"
            )
        found.mounting = mounting

    def _write(self) -> None:
        found = self.found
        rig = Rig(
            **self._rig,
            view=need(found.view, "the table"),
            puck=need(found.puck, "the puck's colour"),
            block=found.block,
            paddle=found.paddle,
            mounting=need(found.mounting, "the robot"),
            tags={str(k): four.tolist() for k, four in found.tags.items()},
            made=date.today().isoformat(),
        )
        rig.save(self._path)

    def state(self) -> dict[str, Any]:
        found, fit = self.found, self.found.mounting
        return {
            **super().state(),
            "kind": "table",
            "puck": found.puck and found.puck.hue,
            "block": found.block and found.block.hue,
            "touches": len(found.places),
            "touches_needed": TOUCHES,
            "robot": fit and round(1e3 * fit.residual, 2),
            "tilt": fit and round(fit.tilt, 2),
        }

    def _detectors(self) -> list[Detector]:
        sizes = (self._table.puck_radius, Scene.block_radius)
        own = [
            self._detector(colour, radius, 0.003)
            for colour, radius in zip(
                (self.found.puck, self.found.block), sizes, strict=True
            )
            if colour is not None
        ]
        return own + super()._detectors()
