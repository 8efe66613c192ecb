"""Film: all pictures of a camera in a video file that survives a kill.

Beside it a text file has a line for each picture: the time at which it was taken, s, of
the monotonic clock. A video's own rate knows of no picture that was missed.
"""

from __future__ import annotations

import threading
import warnings
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import cv2
import numpy as np

from marl_airhockey.devices.camera.camera import Camera, Frame
from marl_airhockey.types import Array

SUFFIX = ".mkv"
"""Ending of the files: Matroska with Motion JPEG, readable as far as it was written"""
FIRST = 4
"""Pictures from which the rate of a camera is found"""
MOST = 90
"""Pictures that may wait to be written: 80 MB of 640 x 480"""
QUALITY = 92
"""JPEG quality"""


class Film:
    """Film of a camera, written by a thread of its own until it is closed.

    Args:
        camera: that is open.
        path: of the file.
    """

    def __init__(self, camera: Camera, path: Path) -> None:
        self._camera, self._path = camera, path
        self._waiting: SimpleQueue[Frame | None] = SimpleQueue()
        self._dropped = 0
        self._writer: Any = None
        self._times = times_file(path).open("w", buffering=1)
        self._last: tuple[int, float] | None = None
        self._failed = False
        self._thread = threading.Thread(target=self._write, name="film", daemon=True)
        self._thread.start()
        camera.listeners.append(self._take)

    @property
    def last(self) -> tuple[int, float] | None:
        """Number in the file, and time taken, s, of the newest picture; None before."""
        return self._last

    @property
    def trouble(self) -> str:
        """What is missing in the file and why; "" while nothing is."""
        if self._failed:
            return f"{self._path}: no video can be written there"
        if self._dropped:
            return (
                f"{self._path}: {self._dropped} pictures are missing, as they came "
                "faster than they could be written"
            )
        return ""

    def _take(self, frame: Frame) -> None:
        if self._waiting.qsize() < MOST:
            self._waiting.put(frame)
        else:
            self._dropped += 1

    def _write(self) -> None:
        first: list[Frame] = []
        count = 0
        while (frame := self._waiting.get()) is not None:
            first.append(frame)
            if self._writer is None and len(first) < FIRST:
                continue
            if self._writer is None and not self._open(first):
                return
            for each in first:
                self._writer.write(each.image)
                self._times.write(f"{each.taken:.6f}\n")
                self._last = count, each.taken
                count += 1
            first.clear()

    def _open(self, frames: list[Frame]) -> bool:
        """Open the file at the rate of some frames; return False if it cannot be."""
        steps = frames[-1].number - frames[0].number
        rate = steps / max(frames[-1].taken - frames[0].taken, 1e-3)
        height, width = frames[0].image.shape[:2]
        code = cv2.VideoWriter.fourcc(*"MJPG")
        self._writer = cv2.VideoWriter(
            str(self._path), code, round(rate, 2), (width, height)
        )
        self._writer.set(cv2.VIDEOWRITER_PROP_QUALITY, QUALITY)
        self._failed = not self._writer.isOpened()
        return not self._failed

    def close(self) -> None:
        """End the file; a warning says what is missing in it."""
        self._camera.listeners.remove(self._take)
        self._waiting.put(None)
        self._thread.join(5.0)
        self._times.close()
        if self._writer is not None:
            self._writer.release()
        if self.trouble:
            warnings.warn(self.trouble, RuntimeWarning, stacklevel=2)


def times_file(path: Path) -> Path:
    """Return the path of the times of a film."""
    return path.with_suffix(".times.txt")


def read_times(path: Path) -> Array:
    """Return the times (N,) at which the pictures of a film were taken, s.

    Raises:
        ValueError: there are none, or what is there are no times.
    """
    file = times_file(path)
    try:
        # The last line may have been cut off.
        lines = file.read_text().split("\n")[:-1]
        return np.array([float(line) for line in lines])
    except (OSError, ValueError) as error:
        raise ValueError(f"{file}: the times of the film: {error}") from error
