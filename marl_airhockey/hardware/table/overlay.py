"""Camera frame with the estimated bodies and marks drawn over it.

The rings of puck and block are yellow, although the palette has dark pucks: they are
estimates and must differ from the real bodies in the frame. The ring of the puck can be
next to it, because the estimate is of the current time and the frame is older by its
latency. All lines have dark edges, so that they are visible on a bright table.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import cv2
import numpy as np

from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.sim.contracts.camera_model import FrameWindow
from marl_airhockey.sim.contracts.mark import Mark, Meaning
from marl_airhockey.sim.contracts.palette import LIGHT, SEATS, rgb
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import Table
from marl_airhockey.types import Array

CIRCLE = np.stack([f(np.linspace(0, 2 * np.pi, 37)) for f in (np.cos, np.sin)], 1)
PUCK, PADDLE, RAIL, EDGE = (
    rgb(colour)
    for colour in (LIGHT["estimate"], SEATS[0], LIGHT["print"], LIGHT["ink"])
)
MARKS = {meaning: rgb(LIGHT[meaning]) for meaning in get_args(Meaning)}
"""Colours of marks by meaning."""
AHEAD = 0.15
"""Time for which the velocity line extends the puck's motion, s."""


class Overlay:
    """Overlay for one view of one table.

    Args:
        view: View of the camera.
        table: Table in the view.
    """

    def __init__(self, view: CameraView, table: Table) -> None:
        self._view, self._table = view, table

    def draw(
        self,
        image: Array,
        paddle: Array,
        puck: Array | None,
        block: Array | None,
        marks: Sequence[Mark],
        width: int,
    ) -> Array:
        """Return an RGB image (H, W, 3) uint8 that is ``width`` pixels wide.

        Args:
            image: Frame (H, W, 3) uint8, blue, green, red.
            paddle: Position (2,) of the paddle, table frame, m.
            puck: Position, m, and velocity, m/s, of the puck (4,), table frame; None
                without a puck.
            block: Position (2,) of the block, m; None without one.
            marks: Marks of the scenario.
            width: Width of the result, px.
        """
        drawn = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
        table = self._table
        corners = np.asarray(table.vertices)
        self._line(drawn, np.vstack([corners, corners[:1]]), RAIL)
        for mark in marks:
            colour = MARKS[mark.means]
            if mark.kind == "circle":
                self._line(drawn, np.array(mark.start) + mark.radius * CIRCLE, colour)
            else:
                self._line(drawn, np.array([mark.start, mark.end]), colour)
        self._line(drawn, paddle + table.paddle_radius * CIRCLE, PADDLE)
        if block is not None:
            self._line(drawn, block + Scene.block_radius * CIRCLE, PUCK)
        if puck is not None:
            self._line(drawn, puck[:2] + table.puck_radius * CIRCLE, PUCK)
            self._line(drawn, np.stack([puck[:2], puck[:2] + AHEAD * puck[2:]]), PUCK)
        return scaled(np.asarray(drawn), width)

    def _line(self, image: Array, points: Array, colour: tuple[int, int, int]) -> None:
        """Draw a line with dark edges through points (n, 2) on the table."""
        flat = np.column_stack([points, np.zeros(len(points))])
        pixels = np.round(self._view.project(flat) * 16).astype(np.int32)
        for ink, width in ((EDGE, 4), (colour, 2)):
            cv2.polylines(image, [pixels], False, ink, width, cv2.LINE_AA, 4)


def scaled(image: Array, width: int) -> Array:
    """Return an image (H, W, 3) uint8 that is ``width`` pixels wide."""
    if width == image.shape[1]:
        return image
    height = round(width * image.shape[0] / image.shape[1])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))


def cropped(image: Array, window: FrameWindow, size: int) -> Array:
    """Return a window of a frame (H, W, 3) as an image (size, size, 3) uint8.

    It is black beyond the edge of the frame.
    """
    high, wide = image.shape[:2]
    square = np.zeros((window.side, window.side, 3), np.uint8)
    top, left = max(window.top, 0), max(window.left, 0)
    bottom, right = (
        min(window.top + window.side, high),
        min(window.left + window.side, wide),
    )
    y, x = top - window.top, left - window.left
    square[y : y + bottom - top, x : x + right - left] = image[top:bottom, left:right]
    return np.asarray(cv2.resize(square, (size, size), interpolation=cv2.INTER_AREA))
