"""Lens and view of a camera, which convert points above a table to pixels and back.

Only points are transformed, not images, which is as exact and takes microseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.types import Array


@dataclass(frozen=True)
class Lens:
    """Lens of a camera.

    Raises:
        ValueError: A field is wrong, or the matrix is not that of a camera.
    """

    matrix: tuple[tuple[float, float, float], ...]
    """Camera matrix (3, 3), px."""
    distortion: tuple[float, ...]
    """Coefficients in OpenCV's order: k1, k2, p1, p2, k3."""
    size: tuple[int, int]
    """Width and height of the frames, px."""
    residual: float = 0.0
    """Root mean square error of the calibration, px."""

    def __post_init__(self) -> None:
        check_fields(self, size=(16, 16384), distortion=(-1e3, 1e3), residual=(0, 100))
        (fx, skew, _), (zero, fy, _), last = self.matrix
        if min(fx, fy) <= 0.0 or (skew, zero, *last) != (0.0, 0.0, 0.0, 0.0, 1.0):
            raise ValueError(
                f"matrix: {self.matrix}; expected [[fx, 0, cx], [0, fy, cy], [0, 0, "
                "1]], fx and fy above 0"
            )

    @cached_property
    def arrays(self) -> tuple[Array, Array]:
        """Camera matrix and distortion."""
        return np.array(self.matrix, float), np.array(self.distortion, float)


@dataclass(frozen=True)
class CameraView:
    """View of a table by a fixed camera.

    Raises:
        ValueError: A field is wrong, or the camera is below the table.
    """

    lens: Lens
    rotation: tuple[float, float, float]
    """Rotation vector from the table frame to the camera frame, rad."""
    translation: tuple[float, float, float]
    """Centre of the table, camera frame, m."""
    residual: float = 0.0
    """Root mean square error of the calibration, px."""

    def __post_init__(self) -> None:
        check_fields(self, rotation=(-10, 10), translation=(-20, 20), residual=(0, 100))
        if self.centre[2] <= 0.0:
            raise ValueError(
                f"translation: the camera is {-self.centre[2]:.2f} m below the table; "
                "expected above it"
            )

    @cached_property
    def _pose(self) -> tuple[Array, Array]:
        matrix = cv2.Rodrigues(np.array(self.rotation, float))[0]
        return matrix, np.array(self.translation, float)

    @property
    def matrix(self) -> Array:
        """Rotation (3, 3) from the table frame to the camera frame."""
        return self._pose[0]

    @cached_property
    def centre(self) -> Array:
        """Position (3,) of the camera, table frame, m."""
        rotation, translation = self._pose
        return np.asarray(-rotation.T @ translation)

    def project(self, points: Array) -> Array:
        """Return the pixels (n, 2) of points (n, 3), table frame, m."""
        pixels, _ = cv2.projectPoints(
            np.asarray(points, float).reshape(-1, 1, 3),
            np.array(self.rotation, float),
            np.array(self.translation, float),
            *self.lens.arrays,
        )
        return np.asarray(pixels).reshape(-1, 2)

    def to_table(self, pixels: Array, height: float = 0.0) -> Array:
        """Return the positions (n, 2), m, of pixels (n, 2) at a height above the table.

        Args:
            pixels: Pixels (n, 2), px.
            height: Height above the table, m.
        """
        flat = np.asarray(pixels, float).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(flat, *self.lens.arrays).reshape(-1, 2)
        rotation, _ = self._pose
        directions = np.column_stack([rays, np.ones(len(rays))]) @ rotation
        steps = (height - self.centre[2]) / directions[:, 2]
        return np.asarray(self.centre[:2] + steps[:, None] * directions[:, :2])

    def scale(self, place: Array, height: float = 0.0) -> float:
        """Return the scale of the image, px/m, at a position (2,), table frame, m."""
        x, y = place
        ends = [[x, y, height], [x + 0.01, y, height], [x, y + 0.01, height]]
        here, ahead, aside = self.project(np.array(ends))
        ax, ay = ahead - here
        bx, by = aside - here
        return float(100.0 * np.sqrt(abs(ax * by - ay * bx)))
