"""Devices of one real table and their calibration, in one JSON file."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.hardware.camera import LATENCY
from marl_airhockey.hardware.rig_file import check_tags, load_rig, save_rig
from marl_airhockey.hardware.robot.config import (
    PAYLOADS,
    Pendant,
    RobotConfig,
    ServoSettings,
    check_pendant,
    check_tool,
)
from marl_airhockey.hardware.robot.filters import Smoothing
from marl_airhockey.hardware.robot.mounting import Mounting
from marl_airhockey.hardware.robot.shaper import MotionLimits
from marl_airhockey.hardware.vision.colour import Colour
from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.sim.contracts.camera_model import BLOCK, PADDLE, CameraModel
from marl_airhockey.sim.core.checks import build, check_fields
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

LAB = re.compile(r"lab:\d+")
"""Pattern of an operator that is a virtual lab."""
LATEST = 0.2
"""Longest time until a stop begins, s, as part of the stopping distance that a rig
reports."""


@dataclass(frozen=True)
class Rig:
    """Description of a real table for the backend ``real``.

    Raises:
        ValueError: A field has the wrong type or is outside its range, or the limits
            are too close to the limits at the pendant.
    """

    table: str
    """Name of the table's preset."""
    camera: str
    """Source of the frames, see `camera.open_source`."""
    view: CameraView
    puck: Colour
    """Colour of the puck."""
    robot: str
    """Address of the arm's controller."""
    mounting: Mounting
    tool: tuple[float, ...] = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
    """Pose of the paddle's foot, flange frame, m and rad."""
    payload: float = 0.6
    """Mass of the paddle and its holder, kg."""
    latency: float = LATENCY
    """Time from the middle of an exposure until its frame has arrived, s; ``airhockey
    calibrate delay`` measures it."""
    readout: float = 0.0
    """Time between the exposures of the first and the last row of a frame, s."""
    tags: dict[str, list[list[float]]] = field(default_factory=dict)
    """Corners of the printed tags by number, table frame, m."""
    limits: MotionLimits = field(default_factory=MotionLimits)
    pendant: Pendant = field(default_factory=Pendant)
    smoothing: Smoothing = field(default_factory=Smoothing)
    """Filter of the commands."""
    servo: ServoSettings = field(default_factory=ServoSettings)
    """Settings of the control loops in the controller, and the usual lag of the arm."""
    operator: str = "person"
    """Operator who puts the puck on the table, "person" or "lab:PORT"."""
    puck_marked: bool = False
    """True for a puck with a mark, by which the camera sees its spin, see
    `vision.mark`."""
    block: Colour | None = None
    """Colour of the block; None without one."""
    paddle: Colour | None = None
    """Colour of the paddle's top, for its detection in videos; None if unknown."""
    exposure: float = 1 / 120
    """Exposure time of the camera, s."""
    period: float = 1 / 60
    """Time between two frames of the camera, s, which ``airhockey calibrate delay``
    measures."""
    dropped: float = 0.0
    """Share of the camera's frames that do not arrive, which it measures, too."""
    made: str = ""
    """Date of the calibration."""

    def __post_init__(self) -> None:
        times = dict.fromkeys(("exposure", "readout", "period"), (0, 0.1))
        check_fields(self, payload=PAYLOADS, latency=(0, 1), dropped=(0, 0.5), **times)
        if self.table not in TABLES:
            raise ValueError(f"table: {unknown_name('table', self.table, TABLES)}")
        if self.operator != "person" and not LAB.fullmatch(self.operator):
            raise ValueError(
                f"operator: {self.operator!r}; expected person or lab:PORT"
            )
        check_tool(self.tool)
        check_tags(self.tags)
        check_pendant(self.limits, self.pendant)

    def robot_config(self, reach: tuple[tuple[float, float], ...]) -> RobotConfig:
        """Return the configuration of the robot client for the workspace of a seat."""
        return RobotConfig(
            host=self.robot,
            mounting=self.mounting,
            reach=reach,
            limits=self.limits,
            tool=self.tool,
            payload=self.payload,
            smoothing=self.smoothing,
            servo=self.servo,
            pendant=self.pendant,
        )

    def motion_words(self, reach: tuple[tuple[float, float], ...]) -> str:
        """Return a text for a person: where the paddle may move, and how fast."""
        (left, low), (right, high) = np.min(reach, 0), np.max(reach, 0)
        stop = LATEST * self.limits.speed + self.limits.stopping_distance
        return (
            f"The paddle will move within x {left:+.2f} .. {right:+.2f} m and y "
            f"{low:+.2f} .. {high:+.2f} m of the table's centre, with up to "
            f"{self.limits.speed} m/s. A stop begins within {LATEST} s, and the paddle "
            f"comes to rest within {stop:.2f} m. The arm moves above and behind it."
        )

    @cached_property
    def camera_model(self) -> CameraModel:
        """Model of the camera, for observations in a simulation."""
        view, base = self.view, self.mounting.to_table(np.zeros(3)).tolist()
        return CameraModel(
            view.lens.matrix,
            view.lens.distortion,
            view.lens.size,
            tuple(tuple(row) for row in view.matrix.tolist()),
            view.translation,
            (base[0], base[1]),
            *(self.latency, self.period, self.exposure, self.dropped),
            puck=self.puck.rgb,
            paddle=self.paddle.rgb if self.paddle else PADDLE,
            block=self.block.rgb if self.block else BLOCK,
            tags=tuple(tuple((x, y) for x, y in four) for four in self.tags.values()),
        )

    @property
    def known_tags(self) -> dict[int, Array]:
        """Corners (4, 2) of the tags by number, table frame, m."""
        return {int(k): np.array(four) for k, four in self.tags.items()}

    def save(self, path: Path) -> None:
        """Write the rig as JSON."""
        save_rig(path, "table", asdict(self))

    @staticmethod
    def load(path: Path) -> Rig:
        """Read a rig.

        Raises:
            ValueError: The file is missing, or its format or a field is wrong.
        """
        return Rig.from_fields(path, load_rig(path, "table"))

    @staticmethod
    def from_fields(path: Path, given: dict[str, Any]) -> Rig:
        """Return the rig with the fields from a file.

        Args:
            path: Path of the file, for messages.
            given: Fields by name.

        Raises:
            ValueError: A field is missing or wrong. The message names the field.
        """
        try:
            return build(Rig, given)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
