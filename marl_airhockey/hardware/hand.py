"""Position and velocity of a paddle that a person moves under a camera."""

from __future__ import annotations

import time
from contextlib import ExitStack
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from marl_airhockey.hardware.camera import Camera, open_source
from marl_airhockey.hardware.hand_rig import HandRig
from marl_airhockey.hardware.vision.calibration import view_trouble
from marl_airhockey.hardware.vision.watcher import Watcher
from marl_airhockey.types import Array

LOST = 0.25
"""Time without a sighting after which the hand counts as absent, s."""
AHEAD = 0.12
"""Longest time of an extrapolation from the last sighting, s."""
JERK = 60.0
"""Standard deviation of a hand's jerk, m/s3, about that of strokes of 0.2 m at 2 Hz."""
START = (0.001, 1.0, 10.0)
"""Standard deviations of position, m, velocity, m/s, and acceleration, m/s2, of a hand
that enters the image."""
NOISE = 0.001
"""Standard deviation of the position of a sighting, m."""


class HandMotion(NamedTuple):
    """Present motion of a hand, field frame."""

    place: Array
    """Position (2,), m."""
    velocity: Array
    """Velocity (2,), m/s."""
    age: float
    """Time since the last sighting, s."""


class Hand:
    """Hand under the camera of a rig, used in a ``with`` block.

    A Kalman filter with a random jerk estimates the motion from the sightings.

    Args:
        rig: Rig of the hand.
    """

    def __init__(self, rig: HandRig) -> None:
        self._rig = rig
        self._devices = ExitStack()
        self._mean, self._covariance = np.zeros((3, 2)), np.eye(3)
        self._taken: float | None = None

    def __enter__(self) -> Self:
        """Open the camera.

        Raises:
            CameraError: There is no such camera.
            RuntimeError: No frame arrives, or it does not fit the calibration.
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
                f"the hand's {self._camera.trouble}; check that {self._rig.camera} is "
                "the camera"
            )
        trouble = view_trouble(self._rig.view, [frame.image], self._rig.known_tags)
        if trouble:
            raise RuntimeError(
                f"the hand's camera: {trouble} (airhockey calibrate --hand)"
            )

    @property
    def trouble(self) -> str:
        """Reason why there is no motion; "" without a problem."""
        if self._camera.trouble:
            return f"the hand's {self._camera.trouble}"
        if self._taken is None or time.monotonic() - self._taken > LOST:
            return "the hand's paddle is not in the image"
        return ""

    def read(self) -> HandMotion | None:
        """Return the present motion of the hand, or None while it is not visible."""
        for sighting in self._watcher.take():
            self._update(sighting.place, sighting.taken)
        if self._taken is None:
            return None
        age = time.monotonic() - self._taken
        if age > LOST:
            return None
        position, velocity, _ = _flow(min(age, AHEAD)) @ self._mean
        return HandMotion(position, velocity, age)

    def _update(self, position: Array, taken: float) -> None:
        """Update the mean: rows of position, velocity and acceleration.

        Both axes share one covariance, as their noise is the same.

        Args:
            position: Position (2,) of a sighting, field frame, m.
            taken: Time of the sighting, s.
        """
        if self._taken is None or taken - self._taken > LOST:
            self._mean = np.stack([position, np.zeros(2), np.zeros(2)])
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
        self._mean = mean + gain[:, None] * (position - mean[0])
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
    """Return the transition matrix (3, 3) of position, velocity and acceleration."""
    return np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
