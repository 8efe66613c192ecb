"""Rig: the devices at one real table and how they are calibrated, in one JSON file."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.devices.camera import LATENCY
from marl_airhockey.devices.rig_file import load_rig, save_rig
from marl_airhockey.devices.robot.config import DriverConfig, Pendant, check_pendant
from marl_airhockey.devices.robot.filters import Smoothing
from marl_airhockey.devices.robot.mounting import Mounting
from marl_airhockey.devices.robot.shaper import MotionLimits
from marl_airhockey.devices.vision.colour import Colour
from marl_airhockey.devices.vision.lens import View
from marl_airhockey.types import Array

LATEST = 0.2
"""Time until a stop begins, at most, in the stopping distance that is told, s"""


@dataclass(frozen=True)
class Rig:
    """Rig: what backend ``real`` needs to know of a table.

    Raises:
        ValueError: limits above what the pendant's leave room for.
    """

    table: str
    """Name of the table's preset"""
    camera: str
    """Source of the pictures, see `camera.open_source`"""
    view: View
    puck: Colour
    """Colour of the puck"""
    robot: str
    """Address of the arm's controller"""
    mounting: Mounting
    tool: tuple[float, ...] = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
    """Pose of the paddle's foot in the flange's frame, m and rad"""
    payload: float = 0.6
    """Mass of the paddle and what holds it, kg"""
    latency: float = LATENCY
    """Time from the middle of an exposure until its picture is here, s, which
    ``airhockey calibrate delay`` measures"""
    readout: float = 0.0
    """Time between the first and the last row of a picture, s"""
    tags: dict[str, list[list[float]]] = field(default_factory=dict)
    """Corners of the printed tags by number, table frame, m"""
    limits: MotionLimits = field(default_factory=MotionLimits)
    pendant: Pendant = field(default_factory=Pendant)
    smoothing: Smoothing = field(default_factory=Smoothing)
    """Filter of the commands"""
    operator: str = "person"
    """Who puts the puck on the table: "person" or "lab:PORT" """
    paddle: Colour | None = None
    """Colour of the paddle's top, by which it is found in videos; None if unknown"""
    made: str = ""
    """Date of the calibration"""

    def __post_init__(self) -> None:
        check_pendant(self.limits, self.pendant)

    def driver_config(self, reach: tuple[tuple[float, float], ...]) -> DriverConfig:
        """Return what the driver of its arm has to know, for a seat's reach."""
        return DriverConfig(
            host=self.robot,
            mounting=self.mounting,
            reach=reach,
            limits=self.limits,
            tool=self.tool,
            payload=self.payload,
            smoothing=self.smoothing,
            pendant=self.pendant,
        )

    def motion_words(self, reach: tuple[tuple[float, float], ...]) -> str:
        """Return where the paddle may move and how fast, in words."""
        (left, low), (right, high) = np.min(reach, 0), np.max(reach, 0)
        stop = LATEST * self.limits.speed + self.limits.stopping_distance
        return (
            f"The paddle will move within x {left:+.2f} .. {right:+.2f} m and y "
            f"{low:+.2f} .. {high:+.2f} m of the table's centre, with up to "
            f"{self.limits.speed} m/s; stopped within {LATEST} s, it comes to rest "
            f"{stop:.2f} m on. The arm sweeps the space above and behind it."
        )

    @property
    def known_tags(self) -> dict[int, Array]:
        """Corners (4, 2) of the tags by number, table frame, m."""
        return {int(k): np.array(four) for k, four in self.tags.items()}

    def save(self, path: Path) -> None:
        """Write it as JSON."""
        save_rig(path, "table", asdict(self))

    @staticmethod
    def load(path: Path) -> Rig:
        """Read it.

        Raises:
            ValueError: a file that is missing, of another format, or holds something
                that makes no sense, named.
        """
        return Rig.from_fields(path, load_rig(path, "table"))

    @staticmethod
    def from_fields(path: Path, given: dict[str, Any]) -> Rig:
        """Return the rig of the fields that a file holds.

        Raises:
            ValueError: something is missing or makes no sense, named.
        """
        try:
            return _rig(given)
        except (KeyError, TypeError) as error:
            raise ValueError(f"{path}: {error} is missing or wrong") from error


def _smoothing(given: Any) -> Smoothing:
    """Return the filter of a file; older ones hold the time of a low pass alone."""
    if isinstance(given, dict):
        return Smoothing(**given)
    return Smoothing("low_pass", float(given)) if given else Smoothing()


def _rig(given: dict[str, Any]) -> Rig:
    mounting = dict(given["mounting"])
    rotation = tuple(tuple(row) for row in mounting["rotation"])
    own = {"view", "mounting", "puck", "paddle"}
    plain = {f.name for f in fields(Rig)} - own
    parts = {name: given[name] for name in plain & given.keys()}
    parts["tool"] = tuple(parts["tool"])
    parts["limits"] = MotionLimits(**parts["limits"])
    parts["pendant"] = Pendant(**parts["pendant"])
    parts["smoothing"] = _smoothing(parts.get("smoothing", {}))
    paddle = given.get("paddle")
    return Rig(
        view=View.from_json(given["view"]),
        mounting=Mounting(
            tuple(mounting["origin"]),
            rotation,
            tuple(mounting["tool"]),
            mounting["residual"],
            mounting["points"],
        ),
        puck=Colour(**given["puck"]),
        paddle=None if paddle is None else Colour(**paddle),
        **parts,
    )
