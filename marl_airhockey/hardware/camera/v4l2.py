"""Camera of this machine, by V4L2, with all automatic controls switched off.

Automatic exposure, gain and white balance would change the calibrated colours. They are
always switched off.
"""

from __future__ import annotations

import os
import re
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import cv2

from marl_airhockey.hardware.camera.camera import CameraError, CameraFrame

LATENCY = 0.025
"""Latency without a measurement, from the middle of an exposure until its frame has
arrived, s: half an exposure of 8 ms, the readout and the transfer of a PS Eye."""
GET_CONTROL, SET_CONTROL = 0xC008561B, 0xC008561C
"""Requests VIDIOC_G_CTRL and VIDIOC_S_CTRL of the kernel's interface, videodev2.h."""
SLOWER = 0.05
"""Share by which the frame rate may differ from the requested one."""
RECENT = 1.0
"""Age of a kernel driver's time stamp beyond which it is of another clock, s."""
CONTROL = struct.Struct("=Ii")
"""Number of a control and its value."""
AUTOMATIC = {
    "exposure": (0x009A0901, 1),
    "gain": (0x00980912, 0),
    "white balance": (0x0098090C, 0),
}
"""Automatic controls, and the values that switch them off."""
CONTROLS = {
    "exposure": (0x009A0902, 0x00980911),
    "gain": (0x00980913,),
    "white_balance": (0x0098091A,),
}
"""Controls of each setting; a camera has one of them."""


@dataclass(frozen=True)
class CaptureSettings:
    """Settings of a camera, in its own units (``v4l2-ctl --list-ctrls``).

    Raises:
        ValueError: Width, height or rate is not above 0.
    """

    width: int = 640
    """Width of the frames, px."""
    height: int = 480
    """Height of the frames, px."""
    rate: int = 60
    """Frame rate, 1/s."""
    exposure: int | None = None
    """Exposure. None keeps the present value, here and in the next two fields."""
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
            ValueError: A name is unknown, or a value is not a whole number.
        """
        known = [f.name for f in fields(CaptureSettings)]
        for name, value in words.items():
            if name not in known:
                raise ValueError(f"camera: unknown setting {name!r}; expected {known}")
            if not re.fullmatch(r"-?\d+", value):
                raise ValueError(f"camera: {name}={value!r} must be a whole number")
        return CaptureSettings(**{name: int(value) for name, value in words.items()})


class CapturedSource:
    """Source of the frames of a V4L2 camera.

    Args:
        device: Number of the video device.
        settings: Settings of the camera; None for the defaults.
        latency: Time from the middle of an exposure until its frame has arrived, s.
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
        self._transfer = RECENT
        self._capture: Any = None

    def open(self) -> None:
        self._check_device()
        settings = self._settings
        capture = cv2.VideoCapture(self._device, cv2.CAP_V4L2)
        if not capture.isOpened():
            raise CameraError(
                f"{self._path} cannot be opened; close other applications that use it"
            )
        self._capture = capture
        # By default, a PS Eye sends raw Bayer frames at 30 Hz.
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"YUYV"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
        capture.set(cv2.CAP_PROP_FPS, settings.rate)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        width = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if (width, height) != (settings.width, settings.height):
            raise CameraError(
                f"{self._path} delivers frames of {width} x {height}, not of "
                f"{settings.width} x {settings.height}; use a size that it has: "
                f"v4l2:{self._device},width={width},height={height}"
            )
        rate = capture.get(cv2.CAP_PROP_FPS)
        if abs(rate - settings.rate) > SLOWER * settings.rate:
            raise CameraError(
                f"{self._path} delivers {rate:g} frames per second, not "
                f"{settings.rate}; use a rate that it has at this size: "
                f"v4l2:{self._device},rate={rate:.0f}"
            )
        self._set_controls()

    def _check_device(self) -> None:
        """Check that the device exists and may be opened.

        Raises:
            CameraError: The device cannot be used. The message contains a remedy.
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
        """Switch automatic controls off and apply the given settings.

        Raises:
            CameraError: The camera rejects a given value.
        """
        descriptor = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)
        try:
            for name, (control, value) in AUTOMATIC.items():
                # Some cameras lack some of these controls.
                _set_control(descriptor, control, value)
                if _get_control(descriptor, control) not in (None, value):
                    raise CameraError(
                        f"{self._path}: automatic {name} stays on, "
                        "which would change the calibrated colours; switch it off "
                        "with v4l2-ctl, or use another camera"
                    )
            for name, controls in CONTROLS.items():
                value = getattr(self._settings, name)
                if value is None:
                    continue
                taken = [c for c in controls if _set_control(descriptor, c, value)]
                if not any(_get_control(descriptor, c) == value for c in taken):
                    raise CameraError(
                        f"{self._path} refuses {name}={value}; see v4l2-ctl "
                        f"--device {self._device} --list-ctrls"
                    )
        finally:
            os.close(descriptor)

    def read(self) -> CameraFrame | None:
        found, image = self._capture.read()
        if not found:
            raise CameraError(f"{self._path} delivers no more frames")
        self._count += 1
        return CameraFrame(image, self._arrival() - self._latency, self._count - 1)

    def _arrival(self) -> float:
        """Return the arrival time of the last frame without waiting time, s.

        The time stamp of the kernel driver does not depend on the scheduling of this
        process. The latency counts from the least time between the stamp and the
        arrival.
        """
        now = time.monotonic()
        stamp: float = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
        if not 0.0 <= now - stamp < RECENT:
            return now
        self._transfer = min(self._transfer, now - stamp)
        return stamp + self._transfer

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()


def _ioctl(descriptor: int, request: int, data: bytes) -> bytes:
    import fcntl  # Windows lacks it and has no V4L2.

    return fcntl.ioctl(descriptor, request, data)


def _get_control(descriptor: int, control: int) -> int | None:
    """Return the value of a control; None if the camera lacks it."""
    try:
        packed = _ioctl(descriptor, GET_CONTROL, CONTROL.pack(control, 0))
    except OSError:
        return None
    return int(CONTROL.unpack(packed)[1])


def _set_control(descriptor: int, control: int, value: int) -> bool:
    """Set a control; return False if the camera rejects it."""
    try:
        _ioctl(descriptor, SET_CONTROL, CONTROL.pack(control, value))
    except OSError:
        return False
    return True
