"""Cameras: sources of pictures with the time at which they were taken.

A `Camera` keeps the newest frame alone, so that whoever looks late sees what is, not
what was.
"""

from marl_airhockey.devices.camera.camera import Camera, CameraError, Frame, Source
from marl_airhockey.devices.camera.film import Film
from marl_airhockey.devices.camera.sources import (
    FileSource,
    StreamSource,
    SyntheticSource,
    open_source,
)
from marl_airhockey.devices.camera.v4l2 import LATENCY, CapturedSource, CaptureSettings

__all__ = [
    "LATENCY",
    "Camera",
    "CameraError",
    "CaptureSettings",
    "CapturedSource",
    "FileSource",
    "Film",
    "Frame",
    "Source",
    "StreamSource",
    "SyntheticSource",
    "open_source",
]
