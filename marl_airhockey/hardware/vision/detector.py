"""Detection of a puck, or of a paddle's top, in one frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from marl_airhockey.hardware.camera.camera import CameraFrame
from marl_airhockey.hardware.vision.colour import Colour
from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.hardware.vision.mark import orientation_of
from marl_airhockey.types import Array

LEAST, MOST = 0.35, 1.8
"""Range of an area that may be a puck, as shares of a whole puck's area."""
WHOLE = 0.93
"""Share above which a puck counts as not hidden."""
OPEN = 0.85
"""Share above which nothing hides the circles on which a mark is read."""
RIM = 2
"""Margin around an area of the colour, px, in which there may be more of it."""
ROUND = 0.12
"""Largest distance of a point of a puck's edge from a fitted circle, in radii."""


class Sighting(NamedTuple):
    """Detected puck, or paddle's top, in one frame."""

    place: Array
    """Position (2,), table frame, m."""
    taken: float
    """Time at which the row of its centre was exposed, monotonic clock, s."""
    share: float
    """Visible share of the disc."""
    pixel: Array
    """Centre (2,) of the disc, px."""
    angle: float = float("nan")
    """Orientation of its mark, rad, modulo pi; nan if no mark was read."""


@dataclass(frozen=True)
class Detector:
    """Detector of a disc of one colour: a puck, or the top of a paddle."""

    view: CameraView
    colour: Colour
    radius: float
    """Radius of the disc, m."""
    extent: tuple[float, float]
    """Half of the table's length and width, m; the search is limited to the table."""
    height: float = 0.003
    """Height of the disc's rim above the table, m."""
    readout: float = 0.0
    """Time between the exposures of the first and the last row, s, for a camera with a
    rolling shutter."""
    marked: bool = False
    """True for a puck with a mark, see `vision.mark`."""

    def find(self, frame: CameraFrame) -> Sighting | None:
        """Return the largest disc of the colour; None without one."""
        return next(self._discs(frame), None)

    def find_all(self, frame: CameraFrame) -> list[Sighting]:
        """Return all discs of the colour.

        Two visible parts of one disc count once, as their completed discs overlap.
        """
        found: list[Sighting] = []
        for seen in self._discs(frame):
            if all(
                np.linalg.norm(seen.place - other.place) > self.radius
                for other in found
            ):
                found.append(seen)
        return found

    def _discs(self, frame: CameraFrame) -> Iterator[Sighting]:
        """Yield the discs among the three largest areas of the colour."""
        x, y, right, bottom = self._part
        image = frame.image[y:bottom, x:right]
        mask = self.colour.mask(image)
        _, labels, stats, middles = cv2.connectedComponentsWithStats(mask)
        for k in 1 + np.argsort(stats[1:, cv2.CC_STAT_AREA])[::-1][:3]:
            found = self._judge(image, labels, stats[k], middles[k], int(k))
            if found is not None:
                position, pixel, share = found
                taken = self._time(frame, pixel)
                angle = self._angle(frame.image, position, share)
                yield Sighting(position, taken, share, pixel, angle)

    def _angle(self, image: Array, position: Array, share: float) -> float:
        """Return the orientation of the mark; nan without one, or if it is hidden."""
        if not self.marked or share < OPEN:
            return float("nan")
        parts = self.view, self.colour, position, self.radius, self.height
        return orientation_of(image, *parts)

    def _time(self, frame: CameraFrame, pixel: Array) -> float:
        rows = frame.image.shape[0]
        return float(frame.taken + self.readout * (float(pixel[1]) / rows - 0.5))

    @cached_property
    def _part(self) -> tuple[int, int, int, int]:
        """Part of a frame that shows the table: left, top, right, bottom, px."""
        along = np.linspace(-1.0, 1.0, 9)
        rim = [(a, s) for a in along for s in (-1.0, 1.0)]
        rim += [(s, a) for a, s in rim]
        reach = np.asarray(self.extent) + 2 * self.radius
        flat = np.column_stack([np.array(rim) * reach, np.full(len(rim), self.height)])
        pixels, (width, height) = self.view.project(flat), self.view.lens.size
        left, top = np.maximum(np.floor(pixels.min(0)), 0).astype(int)
        right, bottom = np.ceil(pixels.max(0)).astype(int)
        return int(left), int(top), min(int(right), width), min(int(bottom), height)

    def _judge(
        self, image: Array, labels: Array, box: Array, middle: Array, label: int
    ) -> tuple[Array, Array, float] | None:
        """Return position, m, pixel and visible share if a component is a disc."""
        corner = np.array(self._part[:2], float)
        middle = middle + corner
        position = self.view.to_table(middle, self.height)[0]
        if (np.abs(position) > np.asarray(self.extent) + self.radius).any():
            return None
        whole = np.pi * (self.radius * self.view.scale(position, self.height)) ** 2
        x, y, width, height = box[:4]
        area, part = float(box[cv2.CC_STAT_AREA]), None
        if self.marked:
            part = (labels[y : y + height, x : x + width] == label).astype(np.uint8)
            area = float(_filled(part).sum())
        share = area / whole
        if not LEAST < share < MOST:
            return None
        if share > WHOLE:
            rim = np.array([x, y]) - RIM
            low = np.maximum(rim, 0)
            high = np.array([x + width, y + height]) + RIM
            patch = image[low[1] : high[1], low[0] : high[0]]
            pixel = self.colour.middle(patch) + low + corner
            return self.view.to_table(pixel, self.height)[0], pixel, min(share, 1.0)
        if part is None:
            part = (labels[y : y + height, x : x + width] == label).astype(np.uint8)
        completed = self._complete(part, np.array([x, y]) + corner)
        if completed is None:
            return None
        pixel = self.view.project(np.array([[*completed, self.height]]))[0]
        return completed, pixel, share

    def _complete(self, part: Array, corner: Array) -> Array | None:
        """Return the centre of a partly hidden disc, from the round part of its edge.

        The radius is known. Of the circles through two points of the edge, the one with
        the most points of the edge is taken and refined on these points.
        """
        contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        edge = max(contours, key=len)[:, 0, :] + corner
        if len(edge) < 12:
            return None
        # The centre of an edge pixel lies half a pixel inside the edge.
        points = self.view.to_table(edge, self.height)
        inner = self.radius - 0.5 / self.view.scale(points.mean(0), self.height)
        tried = points[:: max(len(points) // 16, 1)]
        centres = _centres(tried, inner)
        if not len(centres):
            return None
        gaps = np.abs(np.linalg.norm(points - centres[:, None], axis=-1) - inner)
        close = gaps < ROUND * self.radius
        # No visible part may lie outside of the disc.
        beyond = np.linalg.norm(points - centres[:, None], axis=-1) > 1.15 * self.radius
        score = close.sum(1) - 2 * beyond.sum(1)
        best = int(np.argmax(score))
        on = points[close[best]]
        if len(on) < 0.3 * len(points):
            return None
        centre = centres[best]
        for _ in range(4):
            offsets = on - centre
            sizes = np.linalg.norm(offsets, axis=1)
            directions = offsets / sizes[:, None]
            step, *_ = np.linalg.lstsq(directions, sizes - inner, rcond=None)
            centre = centre + step
        return np.asarray(centre)


def _filled(part: Array) -> Array:
    """Return a mask (h, w) of 0 and 1 without holes, such as that of a mark."""
    contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(part.copy(), contours, -1, 1, cv2.FILLED))


def _centres(points: Array, radius: float) -> Array:
    """Return centres (m, 2) of the circles of one radius through pairs of points."""
    first, second = np.triu_indices(len(points), 3)
    a, b = points[first], points[second]
    half = (b - a) / 2
    square = radius**2 - (half**2).sum(1)
    far = (square > 0) & ((half**2).sum(1) > (0.2 * radius) ** 2)
    half, a = half[far], a[far]
    normal = np.stack([-half[:, 1], half[:, 0]], 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    aside = np.sqrt(square[far])[:, None] * normal
    return np.concatenate([a + half + aside, a + half - aside])
