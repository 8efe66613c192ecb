"""Colour: the pixels that may belong to a puck."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from marl_airhockey.types import Array

HUES = 180
"""Hues that OpenCV has in 8 bits"""
FAINT = 0.2
"""Share of the most colour in a picture below which a pixel does not count"""


@dataclass(frozen=True)
class Colour:
    """Range of colours, by hue, saturation and brightness."""

    hue: float
    """Middle of the range, 0 .. 180; red is at both ends"""
    width: float = 10.0
    """Half-width of the range of hues"""
    saturation: int = 100
    """Least saturation, 0 .. 255"""
    brightness: int = 60
    """Least brightness, 0 .. 255"""

    def mask(self, image: Array) -> Array:
        """Return (H, W) uint8, 255 where a picture (H, W, 3) has this colour."""
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        least = (self.saturation, self.brightness)
        low, high = round(self.hue - self.width), round(self.hue + self.width)
        found = cv2.inRange(hsv, (max(low, 0), *least), (min(high, HUES), 255, 255))
        # Beyond one end of the hues the range goes on at the other.
        beyond = (low + HUES, HUES) if low < 0 else (0, high - HUES)
        if low < 0 or high > HUES:
            more = cv2.inRange(hsv, (beyond[0], *least), (beyond[1], 255, 255))
            found = cv2.bitwise_or(found, more)
        return np.asarray(found)

    @cached_property
    def _axis(self) -> Array:
        """(3,) blue, green, red: direction in which only this hue is coloured."""
        pure = np.array([[[round(self.hue) % HUES, 255, 255]]], np.uint8)
        blue, green, red = cv2.cvtColor(pure, cv2.COLOR_HSV2BGR)[0, 0].astype(float)
        axis = np.array([blue, green, red])
        axis -= axis.mean()
        return np.asarray(axis / np.linalg.norm(axis))

    def middle(self, image: Array) -> Array:
        """Return the middle (2,), px, of what has this colour in a small picture.

        Each pixel counts by how much of the colour it holds. That is linear in light,
        so that a shadow beside it draws it nowhere, as it does a mask.
        """
        amount = image.astype(np.float32) @ self._axis
        weights = np.maximum(amount - FAINT * amount.max(), 0.0)
        total = float(weights.sum()) or 1.0
        across, down = weights.sum(0), weights.sum(1)
        x = float(across @ np.arange(len(across)))
        y = float(down @ np.arange(len(down)))
        return np.array([x, y]) / total

    @staticmethod
    def around(image: Array, pixel: tuple[float, float], radius: int = 4) -> Colour:
        """Return the colours about a pixel (x, y) of something that has one colour.

        Raises:
            ValueError: what is there has no colour: it is grey, white or black.
        """
        x, y = round(pixel[0]), round(pixel[1])
        part = image[max(y - radius, 0) : y + radius + 1, max(x - radius, 0) :]
        part = np.ascontiguousarray(part[:, : 2 * radius + 1])
        if not part.size:
            raise ValueError(f"pixel {pixel}: outside of the picture")
        hsv = cv2.cvtColor(part, cv2.COLOR_BGR2HSV).reshape(-1, 3).astype(float)
        angles = hsv[:, 0] * (2 * np.pi / HUES)
        mean = np.angle(np.exp(1j * angles).mean()) * HUES / (2 * np.pi) % HUES
        saturation, brightness = np.percentile(hsv[:, 1:], 5, axis=0)
        if saturation < 60:
            raise ValueError(
                f"pixel {pixel}: what is there has no colour (saturation "
                f"{saturation:.0f} of 255); click the puck, or give it a colour"
            )
        off = np.abs((hsv[:, 0] - mean + HUES / 2) % HUES - HUES / 2)
        width = max(float(np.percentile(off, 95)) + 4.0, 6.0)
        least = (max(int(0.6 * saturation), 40), max(int(0.6 * brightness), 30))
        return Colour(round(float(mean), 1), round(width, 1), *least)
