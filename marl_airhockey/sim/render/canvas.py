"""Anti-aliased canvas with coordinates in metres, which uses OpenCV."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from marl_airhockey.sim.contracts.look import ROOM, Colour, Shape
from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

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
        self.image = np.full((tall, SMOOTH * width, 3), ROOM, np.uint8)
        self.bottom = tall

    def pixel(self, point: Sequence[float] | Array) -> tuple[int, int]:
        """Return the fixed-point pixel of a point (2,), table frame, m."""
        # The centre of a pixel is half a pixel from its edge.
        x = (float(point[0]) - self.low[0]) * self.scale - 0.5
        y = self.bottom - (float(point[1]) - self.low[1]) * self.scale - 0.5
        return round(x * 2**SHIFT), round(y * 2**SHIFT)

    def paint(self, shape: Shape) -> None:
        """Draw a shape."""
        line = max(round(shape.line * SMOOTH), 1) if shape.line else -1
        points = [self.pixel(point) for point in shape.points]
        style = shape.colour, line, cv2.LINE_AA, SHIFT
        if len(points) == 1:
            size = max(round(shape.radius * self.scale * 2**SHIFT), 1)
            if shape.fill is not None:
                disc = shape.fill, -1, cv2.LINE_AA, SHIFT
                cv2.circle(self.image, points[0], size, *disc)
            cv2.circle(self.image, points[0], size, *style)
        elif len(points) == 2:
            cv2.line(self.image, points[0], points[1], *style)
        elif shape.line:
            cv2.polylines(self.image, [np.array(points, np.int32)], True, *style)
        else:
            corners = [np.array(points, np.int32)]
            cv2.fillPoly(self.image, corners, shape.colour, cv2.LINE_AA, SHIFT)

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
