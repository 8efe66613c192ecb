"""Rectification of camera frames to a view from straight above."""

from __future__ import annotations

import cv2
import numpy as np

from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.types import Array

MARGIN = 0.05
"""Width of the margin around the table, m."""


class Rectifier:
    """Rectifier for one view of one table: x to the right, y up.

    Args:
        view: View of the camera.
        size: Length and width (2,) of the table, m.
    """

    def __init__(self, view: CameraView, size: Array) -> None:
        self._view, self._half = view, np.asarray(size, float) / 2 + MARGIN
        self._maps: dict[int, tuple[Array, Array]] = {}

    @property
    def extent(self) -> tuple[Array, Array]:
        """Lower and upper corner (2,) of the result, table frame, m."""
        return -self._half, self._half.copy()

    def rectify(self, image: Array, width: int) -> Array:
        """Return an image (h, width, 3) uint8, to scale on the table's surface.

        Args:
            image: Image (H, W, 3) uint8 of the camera.
            width: Width of the result, px.
        """
        if width not in self._maps:
            self._maps[width] = self._map(width)
        columns, rows = self._maps[width]
        return np.asarray(cv2.remap(image, columns, rows, cv2.INTER_LINEAR))

    def _map(self, width: int) -> tuple[Array, Array]:
        """Return the source pixels of a result in the format of `cv2.remap`."""
        half_x, half_y = self._half
        height = round(width * half_y / half_x)
        x = ((np.arange(width) + 0.5) / width * 2 - 1) * half_x
        y = (1 - (np.arange(height) + 0.5) / height * 2) * half_y
        points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        flat = np.column_stack([points, np.zeros(len(points))])
        pixels = self._view.project(flat).reshape(height, width, 2).astype(np.float32)
        maps = cv2.convertMaps(pixels, np.array([]), cv2.CV_16SC2)
        return np.asarray(maps[0]), np.asarray(maps[1])
