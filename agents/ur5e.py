"""Real UR5e that a person leads by hand: the paddle is where its tool is."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Self

import numpy as np

from marl_airhockey.devices.rig import Rig
from marl_airhockey.devices.robot.ur5e import PoseReader
from marl_airhockey.toolkit import Driver, PrescribedMotion

SILENT = 0.5
"""Time without news from the arm after which it is an error, s"""


class Ur5e(Driver):
    """Driver that prescribes where the tool of a real arm is; it moves nothing.

    The arm is led by hand, in freedrive, or by a controller of its own; its seat on a
    simulated table follows as the rig's mounting says.

    Raises:
        ValueError: no rig, or one that cannot be read.
    """

    needs_device = True

    def __init__(self, rig: str) -> None:
        self._rig = Rig.load(Path(rig))
        self._reader: PoseReader | None = None
        self._stamp, self._heard = -1.0, 0.0

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_reader": None}

    def __enter__(self) -> Self:
        self._connect()
        return self

    def _connect(self) -> PoseReader:
        """Return the arm's reader; a copy of a driver gets one of its own."""
        if self._reader is None:
            self._reader = PoseReader(self._rig.robot)
            self._heard = time.monotonic()
        return self._reader

    def measured(self) -> PrescribedMotion:
        """Return (1, 4) place and velocity of the tool, as the arm tells them.

        Raises:
            RuntimeError: no controller answers, or it has fallen silent.
        """
        stamp, pose, velocity = self._connect().read()
        now = time.monotonic()
        if stamp != self._stamp:
            self._stamp, self._heard = stamp, now
        elif now - self._heard > SILENT:
            raise RuntimeError(f"robot at {self._rig.robot}: silent for {SILENT} s")
        mounting = self._rig.mounting
        place, way = mounting.to_table(pose), mounting.rotate_to_table(velocity)
        return np.concatenate([place[:2], way[:2]])[None]

    def __exit__(self, *_: object) -> None:
        if self._reader is not None:
            self._reader.close()
            self._reader = None


make = Ur5e
