"""Sources of frames: video files, streams of other processes, and functions."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from marl_airhockey.hardware.camera.camera import CameraError, CameraFrame, Source
from marl_airhockey.hardware.camera.v4l2 import (
    LATENCY,
    CapturedSource,
    CaptureSettings,
)
from marl_airhockey.types import Array

HEADER = struct.Struct(">4sQdII")
"""Header of a frame in a stream: `MAGIC`, number, time taken, height, width."""
MAGIC = b"AIRF"
CONNECT = 3.0
"""Longest time until a stream is connected, s."""


class FileSource:
    """Source of the frames of a video file.

    Args:
        path: Path of the file.
        realtime: True to wait for the time of each frame.
    """

    def __init__(self, path: str | Path, realtime: bool = True) -> None:
        self._path, self._realtime = Path(path), realtime
        self._capture: Any = None
        self._count, self._began, self._first, self.rate = 0, 0.0, 0.0, 0.0

    def open(self) -> None:
        self._capture = cv2.VideoCapture(str(self._path))
        if not self._path.exists() or not self._capture.isOpened():
            raise CameraError(f"{self._path}: there is no video that OpenCV can read")
        self.rate = self._capture.get(cv2.CAP_PROP_FPS) or 30.0
        """Mean number of frames per second."""
        self._began = time.monotonic() if self._realtime else 0.0

    def read(self) -> CameraFrame | None:
        found, image = self._capture.read()
        if not found:
            return None
        due = self._began + self._position()
        if self._realtime:
            time.sleep(max(due - time.monotonic(), 0.0))
        self._count += 1
        return CameraFrame(image, due, self._count - 1)

    def _position(self) -> float:
        """Return the time of the frame that was read, s since the first."""
        now = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
        if not self._count:
            self._first = now
        steady = self._count / self.rate
        # Some files have no times.
        return now - self._first if now > self._first else steady

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()


class StreamSource:
    """Source of raw frames from another process on this machine.

    Args:
        port: TCP port of the stream.
        host: Address of this machine, as the times are of its monotonic clock.
    """

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self._address = host, port
        self._socket: socket.socket | None = None

    def open(self) -> None:
        try:
            self._socket = socket.create_connection(self._address, CONNECT)
        except OSError as error:
            raise CameraError(
                f"no stream at {self._address[0]}:{self._address[1]}: {error}"
            ) from error
        self._socket.settimeout(None)

    def read(self) -> CameraFrame | None:
        head = self._take(HEADER.size)
        if head is None:
            return None
        magic, number, taken, height, width = HEADER.unpack(head)
        if magic != MAGIC:
            raise CameraError(
                f"stream at port {self._address[1]}: expected frames, got other data"
            )
        body = self._take(height * width * 3)
        if body is None:
            return None
        return CameraFrame(
            np.frombuffer(body, np.uint8).reshape(height, width, 3), taken, number
        )

    def _take(self, size: int) -> bytearray | None:
        """Return the next bytes; None if the stream ends before that."""
        assert self._socket is not None
        buffer, done = bytearray(size), 0
        view = memoryview(buffer)
        while done < size:
            try:
                got = self._socket.recv_into(view[done:])
            except OSError:
                return None
            if not got:
                return None
            done += got
        return buffer

    def close(self) -> None:
        if self._socket is not None:
            # Wakes a thread that waits in `read`.
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
            self._socket.close()


class SyntheticSource:
    """Source of frames that a function draws.

    Args:
        draw: Function of the time taken, s, that returns an image (H, W, 3) uint8.
        rate: Frame rate, 1/s.
    """

    def __init__(self, draw: Callable[[float], Array], rate: float = 30.0) -> None:
        self._draw, self._period = draw, 1.0 / rate
        self._ended = threading.Event()
        self._count, self._due = 0, 0.0

    def open(self) -> None:
        self._due = time.monotonic()

    def read(self) -> CameraFrame | None:
        self._due += self._period
        if self._ended.wait(max(self._due - time.monotonic(), 0.0)):
            return None
        self._count += 1
        return CameraFrame(self._draw(self._due), self._due, self._count - 1)

    def close(self) -> None:
        self._ended.set()


def pack_frame(frame: CameraFrame) -> bytes:
    """Return the bytes of a frame in a stream."""
    height, width, _ = frame.image.shape
    head = HEADER.pack(MAGIC, frame.number, frame.taken, height, width)
    return head + frame.image.tobytes()


def open_source(text: str, latency: float = LATENCY) -> Source:
    """Return the source that a text describes.

    Args:
        text: Camera ``v4l2:0`` with settings (``v4l2:0,exposure=60,gain=20``, see
            `CaptureSettings`), ``stream:PORT``, or the path of a video.
        latency: Latency of a V4L2 camera, s, see `CapturedSource`.

    Raises:
        ValueError: The text describes no source, or a setting is unknown.
    """
    kind, _, rest = text.partition(":")
    if kind in ("v4l2", "stream"):
        number, *words = rest.split(",")
        if not number.isdigit() or (words and kind == "stream"):
            raise ValueError(f"camera {text!r}: expected {kind}:NUMBER")
        if kind == "stream":
            return StreamSource(int(number))
        pairs = {name: value for name, _, value in (w.partition("=") for w in words)}
        return CapturedSource(int(number), CaptureSettings.of(pairs), latency)
    if Path(text).exists():
        return FileSource(text)
    raise ValueError(
        f"camera {text!r}: expected v4l2:NUMBER, stream:PORT or the path of a video"
    )
