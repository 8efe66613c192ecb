"""Cameras: sources of frames with the time at which they were taken.

A `Camera` stores only the newest frame, so that a slow reader gets no outdated one.
"""

from marl_airhockey.hardware.camera.camera import (
    Camera,
    CameraError,
    CameraFrame,
    Source,
)
from marl_airhockey.hardware.camera.film import Film
from marl_airhockey.hardware.camera.sources import (
    FileSource,
    StreamSource,
    SyntheticSource,
    open_source,
)
from marl_airhockey.hardware.camera.v4l2 import LATENCY, CapturedSource, CaptureSettings

__all__ = [
    "LATENCY",
    "Camera",
    "CameraError",
    "CameraFrame",
    "CaptureSettings",
    "CapturedSource",
    "FileSource",
    "Film",
    "Source",
    "StreamSource",
    "SyntheticSource",
    "open_source",
]
