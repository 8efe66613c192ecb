"""Film: all frames of a camera in a video file that stays readable after a kill.

A text file next to it has a line for each frame: the time at which it was taken, s,
monotonic clock. The video's constant rate does not show missing frames.
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
"""Suffix of the files: Matroska with Motion JPEG, readable as far as it was written"""
FIRST = 4
"""Number of frames from which the rate of a camera is measured"""
MOST = 90
"""Largest number of frames in the queue: 80 MB of 640 x 480"""
QUALITY = 92
"""JPEG quality"""


class Film:
    """Film of a camera, written by its own thread until it is closed.

    Args:
        camera: Open camera.
        path: Path of the video file.
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
        """Index in the file and time, s, of the newest frame; None before the first."""
        return self._last

    @property
    def trouble(self) -> str:
        """Description of what is missing in the file; "" if it is complete."""
        if self._failed:
            return f"{self._path}: no video can be written to this path"
        if self._dropped:
            return (
                f"{self._path}: {self._dropped} pictures are missing, as they arrived "
                "faster than they could be written"
            )
        return ""

    def _take(self, frame: Frame) -> None:
        if self._waiting.qsize() < MOST:
            self._waiting.put(frame)
        else:
            self._dropped += 1

    def _write(self) -> None:
        """Write frames as they arrive; the first few tell the rate of the file."""
        first: list[Frame] = []
        while (frame := self._waiting.get()) is not None:
            first.append(frame)
            if self._writer is None and len(first) < FIRST:
                continue
            if self._writer is None and not self._open(first):
                return
            self._append(first)
            first.clear()
        if first and self._open(first):
            self._append(first)

    def _append(self, frames: list[Frame]) -> None:
        """Append some frames and their times."""
        count = 0 if self._last is None else self._last[0] + 1
        for each in frames:
            self._writer.write(each.image)
            self._times.write(f"{each.taken:.6f}\n")
            self._last = count, each.taken
            count += 1

    def _open(self, frames: list[Frame]) -> bool:
        """Open the file at the rate of some frames; return whether that worked."""
        steps = frames[-1].number - frames[0].number
        rate = steps / max(frames[-1].taken - frames[0].taken, 1e-3)
        height, width = frames[0].image.shape[:2]
        code = cv2.VideoWriter.fourcc(*"MJPG")
        self._writer = cv2.VideoWriter(
            str(self._path), code, max(round(rate, 2), 1.0), (width, height)
        )
        self._writer.set(cv2.VIDEOWRITER_PROP_QUALITY, QUALITY)
        self._failed = not self._writer.isOpened()
        return not self._failed

    def close(self) -> None:
        """Close the file; warn if frames are missing in it."""
        self._camera.listeners.remove(self._take)
        self._waiting.put(None)
        self._thread.join(5.0)
        self._times.close()
        if self._writer is not None:
            self._writer.release()
        if self.trouble:
            warnings.warn(self.trouble, RuntimeWarning, stacklevel=2)


def times_file(path: Path) -> Path:
    """Return the path of the file with a film's times."""
    return path.with_suffix(".times.txt")


def read_times(path: Path) -> Array:
    """Return the times (N,) at which the frames of a film were taken, s.

    Raises:
        ValueError: The file of times is missing or holds something else.
    """
    file = times_file(path)
    try:
        # The last line may be incomplete.
        lines = file.read_text().split("\n")[:-1]
        return np.array([float(line) for line in lines])
    except (OSError, ValueError) as error:
        raise ValueError(f"{file}: cannot read the film's times: {error}") from error
