"""Camera of the lab: frames of a simulated scene, like those of a real camera.

They have lens distortion, noise, shading, motion blur and shadows. Static objects are
drawn once; only moving objects are drawn in each frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import cv2
import numpy as np

from marl_airhockey.hardware.lab.drawing import enlarged, through_lens
from marl_airhockey.hardware.vision.boards import SQUARE, SQUARES, make_board
from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.sim.contracts.camera_model import FLOOR
from marl_airhockey.types import Array

CIRCLE = np.stack([f(np.linspace(0, 2 * np.pi, 49)[:-1]) for f in (np.cos, np.sin)], 1)
NOISE = 4.0
"""Standard deviation of a pixel's noise."""
NOISES = 6
"""Number of different noise images."""
SHADOW = np.array([0.004, -0.006])
"""Offset (2,) of the shadow of a body about 1 cm high, m."""
AROUND = 24
"""Margin around moving objects that is drawn in each frame, px."""

What = TypeVar("What")
"""Moving objects in front of a camera in the middle of an exposure."""


class LabCamera(ABC, Generic[What]):
    """Camera over a simulated scene.

    Args:
        view: View of the camera.
        exposure: Exposure time, s.
        seed: Seed of the image noise.
    """

    def __init__(
        self, view: CameraView, exposure: float = 1 / 120, seed: int = 0
    ) -> None:
        self.view, self._exposure = view, exposure
        rng, (width, height) = np.random.default_rng(seed), view.lens.size
        self._grain = [
            rng.normal(0, NOISE, (height, width, 3)).astype(np.float32)
            for _ in range(NOISES)
        ]
        self._noise = [grain.astype(np.int16) for grain in self._grain]
        self._empty: list[Array] = []
        self._light: Array = np.ones(1)
        self._shown: Array | None = None
        self.dark = False
        """True if the lights are off, a fault."""
        self.move(view)

    @abstractmethod
    def _draw_still(self, scene: Array, view: CameraView) -> None:
        """Draw the static objects.

        Args:
            scene: Image (H, W, 3) that is drawn on.
            view: View of the image.
        """

    @abstractmethod
    def _draw(
        self, part: Array, seen: What, later: float, corner: tuple[int, int]
    ) -> None:
        """Draw the moving objects at one time during the exposure.

        Args:
            part: Part (h, w, 3) of the image that is drawn on.
            seen: Moving objects in the middle of the exposure.
            later: Time since the middle of the exposure, s.
            corner: Upper left pixel (x, y) of the part in the image.
        """

    @abstractmethod
    def _outlines(self, seen: What) -> list[Array]:
        """Return outlines (n, 2), px, of the moving objects, those in front last."""

    @abstractmethod
    def _speed(self, seen: What) -> float:
        """Return the speed of the fastest object, m/s."""

    def move(self, view: CameraView) -> None:
        """Change the camera's view."""
        width, height = view.lens.size
        across = np.mgrid[0:height, 0:width][1]
        light = (1 - 0.25 * ((across - 200) / width) ** 2)[..., None]
        flat = enlarged(view)
        drawn = np.full((*flat.lens.size[::-1], 3), FLOOR[::-1], np.uint8)
        self._draw_still(drawn, flat)
        still = through_lens(view, drawn).round().astype(np.uint8)
        scene = still * light
        empty = [np.clip(scene + g, 0, 255).astype(np.uint8) for g in self._grain]
        # Assigned last and together, as another thread takes frames in the meantime.
        self.view, self._light, self._still, self._empty = view, light, still, empty

    def show_board(self, number: int | None) -> None:
        """Show a ChArUco board to the camera, or remove it.

        Args:
            number: Number of the board's pose; None without a board.
        """
        self._shown = None
        if number is None:
            return
        rng, size = np.random.default_rng(number), np.array(SQUARES) * SQUARE
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size - size / 2
        rotation, _ = cv2.Rodrigues(rng.uniform(-0.45, 0.45, 3))
        shift = np.array([0.22 * (number % 3 - 1), 0.15 * (number // 3 % 3 - 1), 0.62])
        board = np.column_stack([corners, np.zeros(4)]) @ rotation.T + shift
        flat = enlarged(self.view)
        pixels, _ = cv2.projectPoints(
            board, np.zeros(3), np.zeros(3), flat.lens.arrays[0], None
        )
        drawn = make_board().generateImage((700, 500))
        ends = np.array([(0, 0), (700, 0), (700, 500), (0, 500)], np.float32) - 0.5
        warp = cv2.getPerspectiveTransform(ends, pixels[:, 0].astype(np.float32))
        scene = np.full((*flat.lens.size[::-1], 3), FLOOR[::-1], np.uint8)
        shape = flat.lens.size
        sheet = cv2.warpPerspective(drawn, warp, shape, flags=cv2.INTER_AREA)
        inside = cv2.warpPerspective(np.full_like(drawn, 255), warp, shape)
        scene[inside > 127] = sheet[inside > 127][:, None]
        self._shown = through_lens(self.view, scene) * self._light

    def photograph(self, seen: What, number: int = 0) -> Array:
        """Return the image (H, W, 3) uint8 of the scene.

        Args:
            seen: Moving objects in the middle of the exposure.
            number: Number of the frame, which selects its noise.
        """
        k = number % NOISES
        if self.dark:
            return np.asarray(np.clip(self._noise[k], 0, 255).astype(np.uint8))
        if self._shown is not None:
            lit = np.clip(self._shown + self._noise[k], 0, 255)
            return np.asarray(lit.astype(np.uint8))
        image = self._empty[k].copy()
        for outline in self._outlines(seen):
            x, y, right, bottom = _box(outline, image.shape, AROUND)
            if right <= x or bottom <= y:
                continue
            part = self._expose(seen, (x, y, right, bottom))
            noise = self._noise[k][y:bottom, x:right]
            lit = part * self._light[y:bottom, x:right] + noise
            image[y:bottom, x:right] = np.clip(lit, 0, 255)
        return image

    def _expose(self, seen: What, box: tuple[int, int, int, int]) -> Array:
        """Return a part (left, top, right, bottom) of the image with motion blur."""
        x, y, right, bottom = box
        total = np.zeros((bottom - y, right - x, 3), np.float32)
        # One sample for every two pixels of movement.
        distance = self._speed(seen) * self._exposure * self.view.scale(np.zeros(2)) / 2
        samples = int(np.clip(np.ceil(distance), 1, 8))
        for share in (np.arange(samples) + 0.5) / samples - 0.5:
            part = self._still[y:bottom, x:right].copy()
            self._draw(part, seen, share * self._exposure, (x, y))
            total += part
        return total / samples

    def _disc(self, position: Array, radius: float) -> Array:
        """Return an outline (n, 2), px, around a disc on the table."""
        around = position + 1.2 * radius * CIRCLE
        return self.view.project(np.column_stack([around, np.zeros(len(around))]))


def _box(
    pixels: Array, shape: tuple[int, ...], margin: int
) -> tuple[int, int, int, int]:
    """Return the part of an image around some pixels: left, top, right, bottom."""
    low, high = pixels.min(0) - margin, pixels.max(0) + margin
    return (
        max(int(low[0]), 0),
        max(int(low[1]), 0),
        min(int(high[0]), shape[1]),
        min(int(high[1]), shape[0]),
    )
