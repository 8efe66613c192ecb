"""Video file of all frames of a camera, which stays readable after a kill.

A text file next to it has a line for each frame: the time at which it was taken, s,
monotonic clock. The times in the video count from its first frame.
"""

from __future__ import annotations

import contextlib
import threading
import warnings
from fractions import Fraction
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import cv2
import numpy as np

from marl_airhockey.hardware.camera.camera import Camera, CameraFrame
from marl_airhockey.sim.core.errors import require
from marl_airhockey.types import Array

SUFFIX = ".mkv"
"""Suffix of the files: Matroska with Motion JPEG, readable as far as it was written."""
TICK, RATE = Fraction(1, 1_000_000), 30
"""Unit of a frame's time, s, and the nominal frame rate of the file; the frames have
their own times."""
MOST = 90
"""Largest number of frames in the queue: 80 MB of 640 x 480."""
QUALITY = 92
"""JPEG quality."""


class _Disk:
    """File that stores its first write error, as PyAV would raise a different one.

    Args:
        path: Path of the file.
        broken: List to which the first error is added.
    """

    def __init__(self, path: Path, broken: list[OSError]) -> None:
        self._file, self._broken = path.open("wb", buffering=0), broken
        self.seek, self.tell, self.close = (
            self._file.seek,
            self._file.tell,
            self._file.close,
        )

    def write(self, data: bytes) -> int:
        """Write all of some data, or nothing more after the first error."""
        left = memoryview(data)
        try:
            while left and not self._broken:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._broken.append(error)
        return len(data)


class Film:
    """Video of a camera, written by its own thread until it is closed.

    Args:
        camera: Open camera.
        path: Path of the video file.
    """

    def __init__(self, camera: Camera, path: Path) -> None:
        require("av", "video")
        import av  # noqa: F401  The first import takes a tenth of a second.

        self._camera, self._path = camera, path
        self._waiting: SimpleQueue[CameraFrame | None] = SimpleQueue()
        self._dropped = 0
        self._container: Any = None
        self._stream: Any = None
        self._file: Any = None
        self._broken: list[OSError] = []
        self._began, self._pts = 0.0, -1000
        self._times = times_file(path).open("w", buffering=1)
        self._last: tuple[int, float] | None = None
        self._failure, self._kept = "", 0
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
        if self._failure:
            kept, why = self._kept, self._failure
            return f"{self._path}: ends after {kept} frames: {why}"
        if self._dropped:
            return (
                f"{self._path}: {self._dropped} frames are missing, as they arrived "
                "faster than they could be written"
            )
        return ""

    def _take(self, frame: CameraFrame) -> None:
        if self._failure:
            return
        if self._waiting.qsize() < MOST:
            self._waiting.put(frame)
        else:
            self._dropped += 1

    def _write(self) -> None:
        """Write frames as they arrive, until the disk accepts no more."""
        try:
            while (frame := self._waiting.get()) is not None:
                self._append(frame)
        except OSError as error:
            # The frames written so far remain.
            self._failure = error.strerror or str(error)

    def _append(self, frame: CameraFrame) -> None:
        """Append a frame and its time.

        Raises:
            OSError: The disk accepts no more.
        """
        import av

        if self._stream is None:
            self._open(frame)
        quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
        packet = av.Packet(cv2.imencode(".jpg", frame.image, quality)[1].tobytes())
        packet.stream, packet.time_base, packet.is_keyframe = self._stream, TICK, True
        # Times in the file have a resolution of 1 ms and always increase.
        pts = round((frame.taken - self._began) / TICK)
        self._pts = packet.pts = packet.dts = max(pts, self._pts + 1000)
        self._container.mux_one(packet)
        if self._broken:
            raise self._broken[0]
        self._keep_time()
        count = 0 if self._last is None else self._last[0] + 1
        self._last = count, frame.taken

    def _keep_time(self) -> None:
        """Write the time of the newest frame, which the next one puts on the disk."""
        if self._last is not None:
            self._times.write(f"{self._last[1]:.6f}\n")
            self._kept += 1

    def _open(self, first: CameraFrame) -> None:
        """Open the file for frames like the first."""
        import av

        self._file = _Disk(self._path, self._broken)
        # Each frame is written to the disk immediately, so that a kill loses none.
        options = {"flush_packets": "1", "cluster_time_limit": "1"}
        self._container = av.open(self._file, "w", format="matroska", options=options)
        self._stream = self._container.add_stream("mjpeg", RATE)
        height, width = first.image.shape[:2]
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt, self._stream.time_base = "yuvj420p", TICK
        self._began = first.taken

    def close(self) -> None:
        """Close the file; warn if frames are missing in it."""
        self._camera.listeners.remove(self._take)
        self._waiting.put(None)
        self._thread.join(5.0)
        if self._container is not None:
            self._container.close()
            self._file.close()
            if not self._broken:
                self._keep_time()
        with contextlib.suppress(OSError):
            self._times.close()
        if self.trouble:
            warnings.warn(self.trouble, RuntimeWarning, stacklevel=2)


def times_file(path: Path) -> Path:
    """Return the path of the file with the times of a video."""
    return path.with_suffix(".times.txt")


def read_times(path: Path) -> Array:
    """Return the times (N,) at which the frames of a video were taken, s.

    Raises:
        ValueError: The file of times is missing or has other content.
    """
    file = times_file(path)
    try:
        # The last line may be incomplete.
        lines = file.read_text().split("\n")[:-1]
        return np.array([float(line) for line in lines])
    except (OSError, ValueError) as error:
        raise ValueError(
            f"{file}: cannot read the times of the video: {error}"
        ) from error
