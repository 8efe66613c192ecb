"""Film of a recording: columns that refer to its frames, and the frames."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from marl_airhockey.core.recording import Columns
from marl_airhockey.devices.camera import Film
from marl_airhockey.types import Array


def film_columns(film: Film) -> Columns:
    """Return columns (1, ...) of a film: number and time of its newest frame.

    Before the first frame the number is -1 and the time nan. Times are of the monotonic
    clock, as ``device.moment``, the time of the state.
    """
    number, taken = film.last or (-1, np.nan)
    return {"frame": np.array([number], np.int64), "frame_taken": np.array([taken])}


class FilmFrames:
    """Frames of a film, which are read in order.

    Args:
        path: Path of the film.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._open()

    def _open(self) -> None:
        self._capture = cv2.VideoCapture(str(self.path))
        self._number, self._image = -1, np.zeros((0, 0, 3), np.uint8)

    def picture(self, number: int) -> Array:
        """Return a frame (H, W, 3) uint8, BGR; of a film cut short, the last one.

        Raises:
            ValueError: There is no frame in the film.
        """
        if number < self._number:
            self._open()
        while self._number < number:
            known, image = self._capture.read()
            if not known:
                break
            self._number, self._image = self._number + 1, np.asarray(image)
        if not self._image.size:
            raise ValueError(f"{self.path}: no frame of it can be read")
        return self._image
