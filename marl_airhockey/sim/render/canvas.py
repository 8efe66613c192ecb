"""Anti-aliased canvas with coordinates in metres, which uses OpenCV."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from marl_airhockey.sim.contracts.palette import LIGHT, rgb
from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

Colour = tuple[int, int, int]
"""Colour in RGB, 0 to 255."""
SMOOTH = 2
"""Factor by which the canvas is larger than the image, for anti-aliasing."""
SHIFT = 6
"""Number of fractional bits of OpenCV's fixed-point coordinates."""


class Canvas:
    """Canvas of the table's bounding box and a margin, table frame, m.

    Args:
        table: Table that the canvas shows.
        width: Width of the image, pixels.
        margin: Margin around the table, m.
        bar: Height of the title bar in the image, pixels.
    """

    def __init__(self, table: Table, width: int, margin: float, bar: int) -> None:
        corners = np.asarray(table.vertices)
        self.low, high = corners.min(0) - margin, corners.max(0) + margin
        self.scale = SMOOTH * width / float(high[0] - self.low[0])
        self.bar = SMOOTH * bar
        tall = round(float(high[1] - self.low[1]) * self.scale) + self.bar
        # Video codecs require even sizes.
        tall += -tall % (2 * SMOOTH)
        self.image = np.full((tall, SMOOTH * width, 3), rgb(LIGHT["room"]), np.uint8)
        self.bottom = tall

    def pixel(self, point: Sequence[float] | Array) -> tuple[int, int]:
        """Return the fixed-point pixel of a point (2,), table frame, m."""
        x = (float(point[0]) - self.low[0]) * self.scale
        y = self.bottom - (float(point[1]) - self.low[1]) * self.scale
        return round(x * 2**SHIFT), round(y * 2**SHIFT)

    def disc(
        self, centre: Sequence[float] | Array, radius: float, colour: Colour
    ) -> None:
        """Draw a filled disc; centre (2,) and radius in m."""
        size = max(round(radius * self.scale * 2**SHIFT), 1)
        cv2.circle(self.image, self.pixel(centre), size, colour, -1, cv2.LINE_AA, SHIFT)

    def ring(
        self,
        centre: Sequence[float] | Array,
        radius: float,
        colour: Colour,
        width: float = 1.5,
    ) -> None:
        """Draw a circle; centre (2,) and radius in m, width of the line in pixels."""
        size = max(round(radius * self.scale * 2**SHIFT), 1)
        line = max(round(width * SMOOTH), 1)
        cv2.circle(
            self.image, self.pixel(centre), size, colour, line, cv2.LINE_AA, SHIFT
        )

    def line(
        self,
        start: Sequence[float] | Array,
        end: Sequence[float] | Array,
        colour: Colour,
        width: float = 1.5,
    ) -> None:
        """Draw a straight line; ends (2,) in m, width in pixels."""
        wide = max(round(width * SMOOTH), 1)
        a, b = self.pixel(start), self.pixel(end)
        cv2.line(self.image, a, b, colour, wide, cv2.LINE_AA, SHIFT)

    def polygon(self, corners: Array, colour: Colour, width: float = 0.0) -> None:
        """Fill a polygon (K, 2), m, or draw its outline with ``width`` in pixels."""
        points = np.array([self.pixel(c) for c in corners], np.int32)
        if width:
            wide = max(round(width * SMOOTH), 1)
            cv2.polylines(self.image, [points], True, colour, wide, cv2.LINE_AA, SHIFT)
        else:
            cv2.fillPoly(self.image, [points], colour, cv2.LINE_AA, SHIFT)

    def titles(
        self, left: str, right: str, colours: tuple[Colour, Colour], size: float = 0.55
    ) -> None:
        """Write texts at both ends of the title bar, smaller if they do not fit."""
        font, width, edge = cv2.FONT_HERSHEY_DUPLEX, self.image.shape[1], 22 * SMOOTH
        texts = left, right
        scale = size * SMOOTH
        needed = sum(cv2.getTextSize(t, font, scale, SMOOTH)[0][0] for t in texts)
        scale *= min(1.0, (width - 3 * edge) / max(needed, 1))
        for k, (text, colour) in enumerate(zip(texts, colours, strict=True)):
            (wide, high), _ = cv2.getTextSize(text, font, scale, SMOOTH)
            corner = (width - edge - wide if k else edge, (self.bar + high) // 2)
            cv2.putText(
                self.image, text, corner, font, scale, colour, SMOOTH, cv2.LINE_AA
            )

    def finish(self) -> Array:
        """Return the image (H, W, 3) uint8 RGB, a new array."""
        size = (self.image.shape[1] // SMOOTH, self.image.shape[0] // SMOOTH)
        return np.asarray(cv2.resize(self.image, size, interpolation=cv2.INTER_AREA))
