"""Rig of a hand: a camera above a field on which a person moves a paddle."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from marl_airhockey.hardware.rig_file import check_tags, load_rig, save_rig
from marl_airhockey.hardware.vision.colour import Colour
from marl_airhockey.hardware.vision.detector import Detector
from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.sim.core.checks import build, check_fields
from marl_airhockey.types import Array

KIND = "hand"
"""Kind of rig in the file."""


@dataclass(frozen=True)
class HandRig:
    """Rig of a hand. Field frame: origin at the field's centre, x away from the person.

    Raises:
        ValueError: A field has the wrong type or is outside its range.
    """

    camera: str
    """Source of the frames, see `camera.open_source`."""
    view: CameraView
    """View of the field."""
    paddle: Colour
    """Colour of the paddle's top."""
    size: tuple[float, float]
    """Length, along x, and width of the field, m."""
    radius: float = 0.047625
    """Radius of the paddle, m."""
    height: float = 0.06
    """Height of the paddle's top above the field, m."""
    readout: float = 0.0
    """Time between the exposures of the first and the last row of a frame, s."""
    tags: dict[str, list[list[float]]] = field(default_factory=dict)
    """Corners of the printed tags by number, field frame, m."""
    made: str = ""
    """Date of the calibration."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            size=(0.05, 5),
            radius=(0.005, 0.5),
            height=(0, 0.5),
            readout=(0, 0.1),
        )
        check_tags(self.tags)

    @property
    def known_tags(self) -> dict[int, Array]:
        """Corners (4, 2) of the tags by number, field frame, m."""
        return {int(k): np.array(four) for k, four in self.tags.items()}

    @property
    def detector(self) -> Detector:
        """Detector of the paddle on the field."""
        half = self.size[0] / 2, self.size[1] / 2
        parts = self.view, self.paddle, self.radius, half, self.height
        return Detector(*parts, readout=self.readout)

    def save(self, path: Path) -> None:
        """Write the rig as JSON."""
        save_rig(path, KIND, asdict(self))

    @staticmethod
    def load(path: Path) -> HandRig:
        """Read a rig.

        Raises:
            ValueError: The file is missing, or its format, its kind or a field is
                wrong.
        """
        given = load_rig(path, KIND)
        try:
            return build(HandRig, given)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
