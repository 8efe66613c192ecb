"""Hand: where a person moves a paddle under a camera, and how fast."""

from __future__ import annotations

import time
from contextlib import ExitStack
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from marl_airhockey.devices.camera import Camera, open_source
from marl_airhockey.devices.hand_rig import HandRig
from marl_airhockey.devices.vision.calibration import view_trouble
from marl_airhockey.devices.vision.watcher import Watcher
from marl_airhockey.types import Array

LOST = 0.25
"""Time without a sighting after which the hand has left, s"""
AHEAD = 0.12
"""Longest time by which its motion is carried on from the last sighting, s"""
JERK = 60.0
"""Standard deviation of a hand's jerk, m/s3: about that of strokes of 0.2 m, two a
second"""
START = (0.001, 1.0, 10.0)
"""Standard deviations of place, velocity and acceleration of a hand that comes into the
picture, m and s"""
NOISE = 0.001
"""Standard deviation of a sighting, m"""


class HandMotion(NamedTuple):
    """Motion of a hand now, field's frame."""

    place: Array
    """(2,) m"""
    velocity: Array
    """(2,) m/s"""
    age: float
    """Time since the sighting that it comes from, s"""


class Hand:
    """Hand under the camera of a rig. It is used in a ``with`` block.

    A Kalman filter with a random jerk makes the motion of what the camera sees.

    Args:
        rig: of the hand.
    """

    def __init__(self, rig: HandRig) -> None:
        self._rig = rig
        self._devices = ExitStack()
        self._mean, self._covariance = np.zeros((3, 2)), np.eye(3)
        self._taken: float | None = None

    def __enter__(self) -> Self:
        """Open the camera.

        Raises:
            CameraError: there is none.
            RuntimeError: it shows nothing, or was moved since it was calibrated.
        """
        try:
            self._camera = self._devices.enter_context(
                Camera(open_source(self._rig.camera))
            )
            self._check_camera()
            self._watcher = Watcher(self._camera, self._rig.detector)
            self._devices.callback(self._watcher.close)
        except BaseException:
            self._devices.close()
            raise
        return self

    def _check_camera(self) -> None:
        frame = self._camera.next(seconds=3.0)
        if frame is None:
            raise RuntimeError(
                f"the hand's {self._camera.trouble}: is {self._rig.camera} right?"
            )
        trouble = view_trouble(self._rig.view, [frame.image], self._rig.known_tags)
        if trouble:
            raise RuntimeError(
                f"the hand's camera: {trouble} (airhockey calibrate --hand)"
            )

    @property
    def trouble(self) -> str:
        """Reason why there is no motion; "" while there is."""
        if self._camera.trouble:
            return f"the hand's {self._camera.trouble}"
        if self._taken is None or time.monotonic() - self._taken > LOST:
            return "the hand's paddle is not in the picture"
        return ""

    def read(self) -> HandMotion | None:
        """Return how the hand moves now; None while it is not seen."""
        for sighting in self._watcher.take():
            self._update(sighting.place, sighting.taken)
        if self._taken is None:
            return None
        age = time.monotonic() - self._taken
        if age > LOST:
            return None
        place, velocity, _ = _flow(min(age, AHEAD)) @ self._mean
        return HandMotion(place, velocity, age)

    def _update(self, place: Array, taken: float) -> None:
        """Take a sighting into the mean: rows place, velocity and acceleration.

        Both axes share the covariance, as they share all noise.
        """
        if self._taken is None or taken - self._taken > LOST:
            self._mean = np.stack([place, np.zeros(2), np.zeros(2)])
            self._covariance = np.diag(np.square(START))
            self._taken = taken
            return
        dt = taken - self._taken
        if dt <= 0.0:
            return
        flow, push = _flow(dt), np.array([dt**3 / 6, dt**2 / 2, dt]) * JERK
        covariance = flow @ self._covariance @ flow.T + np.outer(push, push)
        gain = covariance[:, 0] / (covariance[0, 0] + NOISE**2)
        mean = flow @ self._mean
        self._mean = mean + gain[:, None] * (place - mean[0])
        self._covariance = covariance - np.outer(gain, covariance[0])
        self._taken = taken

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._devices.close()


def _flow(dt: float) -> Array:
    """Return (3, 3) by which place, velocity and acceleration go on for a time, s."""
    return np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
