"""Calibration of a camera above the field of a person's paddle."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.hardware.calibration.camera_session import CameraSession, need
from marl_airhockey.hardware.camera import Camera
from marl_airhockey.hardware.hand_rig import HandRig
from marl_airhockey.types import Array

CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
"""Corners of a field, counter-clockwise, in half lengths and widths."""


class HandSession(CameraSession):
    """Calibration session of one camera over the field of a hand.

    Args:
        camera: Open camera over the field.
        source: Source of the camera's frames, see `open_source`.
        size: Length, away from the person, and width of the field, m.
        path: Path of the rig's file.
        measured: Measured corners of tags, see `CameraSession`.
    """

    def __init__(
        self,
        camera: Camera,
        source: str,
        size: tuple[float, float],
        path: Path,
        measured: Mapping[int, Array] | None = None,
    ) -> None:
        corners = CORNERS * np.array(size) / 2
        super().__init__(camera, corners, HandRig.radius, path, measured)
        self._source, self._size = source, size

    def _write(self) -> None:
        found = self.found
        rig = HandRig(
            camera=self._source,
            view=need(found.view, "the field"),
            paddle=need(found.paddle, "the paddle's colour"),
            size=self._size,
            tags={str(k): four.tolist() for k, four in found.tags.items()},
            made=date.today().isoformat(),
        )
        rig.save(self._path)

    def state(self) -> dict[str, Any]:
        return {**super().state(), "kind": "hand"}
