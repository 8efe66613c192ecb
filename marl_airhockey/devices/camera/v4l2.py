"""Camera of this machine, by V4L2, with nothing left to its automatics.

A camera that adapts exposure, gain or white balance changes the colours that the vision
was told; what adapts is switched off, whatever else is set.
"""

from __future__ import annotations

import fcntl
import os
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import cv2

from marl_airhockey.devices.camera.camera import CameraError, Frame

LATENCY = 0.025
"""Time from the middle of an exposure until its picture is here, s, unless it was
measured: half an exposure of 8 ms, the readout and the transfer of a PS Eye"""
SET_CONTROL = 0xC008561C
"""Request VIDIOC_S_CTRL of the kernel's interface, videodev2.h"""
CONTROL = struct.Struct("=Ii")
"""Number of a control and its value"""
AUTOMATIC = {0x009A0901: 1, 0x00980912: 0, 0x0098090C: 0}
"""Values that switch automatic exposure, gain and white balance off"""
CONTROLS = {
    "exposure": (0x009A0902, 0x00980911),
    "gain": (0x00980913,),
    "white_balance": (0x0098091A,),
}
"""Controls of each setting: cameras have one of them"""


@dataclass(frozen=True)
class CaptureSettings:
    """Settings of a camera, in its own units (``v4l2-ctl --list-ctrls``).

    Raises:
        ValueError: a width, height or rate that is not above 0.
    """

    width: int = 640
    """px"""
    height: int = 480
    """px"""
    rate: int = 60
    """Frames a second"""
    exposure: int | None = None
    """None, here and below, for what the camera has now"""
    gain: int | None = None
    white_balance: int | None = None

    def __post_init__(self) -> None:
        for name in ("width", "height", "rate"):
            if getattr(self, name) < 1:
                raise ValueError(
                    f"camera: {name}={getattr(self, name)} must be above 0"
                )

    @staticmethod
    def of(words: Mapping[str, str]) -> CaptureSettings:
        """Return the settings of NAME=VALUE pairs.

        Raises:
            ValueError: an unknown name, or a value that is no whole number.
        """
        known = [f.name for f in fields(CaptureSettings)]
        for name, value in words.items():
            if name not in known:
                raise ValueError(f"camera: unknown setting {name!r}; there are {known}")
            if not value.lstrip("-").isdigit():
                raise ValueError(f"camera: {name}={value!r} must be a whole number")
        return CaptureSettings(**{name: int(value) for name, value in words.items()})


class CapturedSource:
    """Source that is a camera of this machine.

    Args:
        device: its number.
        settings: of its pictures.
        latency: s from the middle of an exposure until the picture is here.
    """

    def __init__(
        self,
        device: int,
        settings: CaptureSettings | None = None,
        latency: float = LATENCY,
    ) -> None:
        self._device, self._path = device, Path(f"/dev/video{device}")
        self._settings = settings or CaptureSettings()
        self._latency, self._count = latency, 0
        self._capture: Any = None

    def open(self) -> None:
        self._check_device()
        settings = self._settings
        capture = cv2.VideoCapture(self._device, cv2.CAP_V4L2)
        if not capture.isOpened():
            raise CameraError(
                f"{self._path} cannot be opened: does another program use it?"
            )
        self._capture = capture
        # A PS Eye would send raw Bayer pictures, 30 a second.
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"YUYV"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
        capture.set(cv2.CAP_PROP_FPS, settings.rate)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        width = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if (width, height) != (settings.width, settings.height):
            self.close()
            raise CameraError(
                f"{self._path} gives pictures of {width} x {height}, not of "
                f"{settings.width} x {settings.height}; name a size that it has: "
                f"v4l2:{self._device},width={width},height={height}"
            )
        self._set_controls()

    def _check_device(self) -> None:
        """Refuse a device that there is not, or that may not be opened.

        Raises:
            CameraError: with the remedy.
        """
        if not self._path.exists():
            there = sorted(str(path) for path in Path("/dev").glob("video*"))
            raise CameraError(
                f"there is no {self._path}; there are: {', '.join(there) or 'none'}"
            )
        if not os.access(self._path, os.R_OK | os.W_OK):
            raise CameraError(
                f"{self._path}: no permission; add yourself to its group (sudo usermod "
                '-aG video "$USER") and log in again'
            )

    def _set_controls(self) -> None:
        """Switch all that is automatic off and set what is given.

        Raises:
            CameraError: the camera refuses a value that was given.
        """
        descriptor = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)
        try:
            for control, value in AUTOMATIC.items():
                # A camera without an automatic has no such control.
                _set_control(descriptor, control, value)
            for name, controls in CONTROLS.items():
                value = getattr(self._settings, name)
                if value is None:
                    continue
                if not any(_set_control(descriptor, c, value) for c in controls):
                    raise CameraError(
                        f"{self._path} refuses {name}={value}; see v4l2-ctl "
                        f"--device {self._device} --list-ctrls"
                    )
        finally:
            os.close(descriptor)

    def read(self) -> Frame | None:
        found, image = self._capture.read()
        if not found:
            raise CameraError(f"{self._path} gives no more pictures")
        self._count += 1
        return Frame(image, time.monotonic() - self._latency, self._count - 1)

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()


def _set_control(descriptor: int, control: int, value: int) -> bool:
    """Set a control; return False if the camera refuses."""
    try:
        fcntl.ioctl(descriptor, SET_CONTROL, CONTROL.pack(control, value))
    except OSError:
        return False
    return True
