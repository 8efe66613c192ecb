"""Range of colours, such as that of a puck, and its pixels in a frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.types import Array

HUES = 180
"""Number of hues of OpenCV in 8 bits."""
PALE, DARK = 60, 0.8
"""Least saturation of a coloured pixel, 0 .. 255, and least brightness, as a share of
the median of its surroundings."""
MARGIN = 0.6
"""Least saturation and brightness of a range, as a share of those of the object."""
FAINT = 0.2
"""Share of the largest amount of a colour below which a pixel does not count."""


@dataclass(frozen=True)
class Colour:
    """Range of colours, by hue, saturation and brightness.

    Raises:
        ValueError: A field is outside its range.
    """

    hue: float
    """Centre of the range, 0 .. 180; red is at both ends."""
    width: float = 10.0
    """Half-width of the range of hues."""
    saturation: int = 100
    """Least saturation, 0 .. 255."""
    brightness: int = 60
    """Least brightness, 0 .. 255."""

    def __post_init__(self) -> None:
        byte = (0, 255)
        check_fields(
            self, hue=(0, HUES), width=(0, HUES), saturation=byte, brightness=byte
        )

    @property
    def rgb(self) -> tuple[int, int, int]:
        """Typical colour of the range as red, green and blue, 0 .. 255."""
        levels = self.saturation, self.brightness
        s, v = (min(level / MARGIN, 255.0) for level in levels)
        pixel = np.array([[[round(self.hue) % HUES, s, v]]], np.uint8)
        red, green, blue = cv2.cvtColor(pixel, cv2.COLOR_HSV2RGB)[0, 0].tolist()
        return red, green, blue

    def mask(self, image: Array) -> Array:
        """Return a mask (H, W) uint8, 255 where an image (H, W, 3) has this colour."""
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        least = (self.saturation, self.brightness)
        low, high = round(self.hue - self.width), round(self.hue + self.width)
        found = cv2.inRange(hsv, (max(low, 0), *least), (min(high, HUES), 255, 255))
        # The hues are a circle: the range continues at the other end.
        beyond = (low + HUES, HUES) if low < 0 else (0, high - HUES)
        if low < 0 or high > HUES:
            more = cv2.inRange(hsv, (beyond[0], *least), (beyond[1], 255, 255))
            found = cv2.bitwise_or(found, more)
        return np.asarray(found)

    @cached_property
    def _axis(self) -> Array:
        """Unit direction (3,) of this hue, orthogonal to grey: blue, green, red."""
        pure = np.array([[[round(self.hue) % HUES, 255, 255]]], np.uint8)
        blue, green, red = cv2.cvtColor(pure, cv2.COLOR_HSV2BGR)[0, 0].astype(float)
        axis = np.array([blue, green, red])
        axis -= axis.mean()
        return np.asarray(axis / np.linalg.norm(axis))

    def amount(self, image: Array) -> Array:
        """Return the amount of the colour (H, W) float32 of each pixel of an image."""
        return np.asarray(image.astype(np.float32) @ self._axis, np.float32)

    def middle(self, image: Array) -> Array:
        """Return the centre (2,), px, of an object of this colour in a small image.

        Each pixel is weighted by its amount of the colour, which is linear in light.
        So a shadow next to the object does not shift the centre, as it does in a mask.
        """
        amount = self.amount(image)
        weights = np.maximum(amount - FAINT * amount.max(), 0.0)
        total = float(weights.sum()) or 1.0
        across, down = weights.sum(0), weights.sum(1)
        x = float(across @ np.arange(len(across)))
        y = float(down @ np.arange(len(down)))
        return np.array([x, y]) / total

    @staticmethod
    def around(image: Array, pixel: tuple[float, float], radius: int = 4) -> Colour:
        """Return the range of the colours around a pixel of an object.

        Args:
            image: Image (H, W, 3) uint8, blue, green, red.
            pixel: Position (x, y), px.
            radius: Half-width of the evaluated square, px.

        Raises:
            ValueError: The pixel is outside of the image, or grey, white or black.
        """
        x, y = round(pixel[0]), round(pixel[1])
        part = image[max(y - radius, 0) : y + radius + 1, max(x - radius, 0) :]
        part = np.ascontiguousarray(part[:, : 2 * radius + 1])
        if not part.size:
            raise ValueError(f"pixel {pixel}: outside of the image")
        hsv = cv2.cvtColor(part, cv2.COLOR_BGR2HSV).reshape(-1, 3).astype(float)
        # A mark on a puck may cover less than half of the square.
        bright = hsv[:, 2] >= DARK * np.median(hsv[:, 2])
        coloured = bright & (hsv[:, 1] >= PALE)
        if coloured.mean() < 0.5:
            raise ValueError(
                f"pixel {pixel}: the object has no colour (saturation "
                f"{np.median(hsv[:, 1]):.0f} of 255); click the puck, or make it "
                "colourful"
            )
        hsv = hsv[coloured]
        angles = hsv[:, 0] * (2 * np.pi / HUES)
        mean = np.angle(np.exp(1j * angles).mean()) * HUES / (2 * np.pi) % HUES
        saturation, brightness = np.percentile(hsv[:, 1:], 5, axis=0)
        off = np.abs((hsv[:, 0] - mean + HUES / 2) % HUES - HUES / 2)
        width = max(float(np.percentile(off, 95)) + 4.0, 6.0)
        least = (max(int(MARGIN * saturation), 40), max(int(MARGIN * brightness), 30))
        return Colour(round(float(mean), 1), round(width, 1), *least)
