"""Printable tags and ChArUco board, as PDF files for A4 paper."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw

from marl_airhockey.hardware.vision.boards import MARKER, SQUARE, SQUARES, make_board
from marl_airhockey.hardware.vision.calibration import TAG, TAGS
from marl_airhockey.types import Array

DPI = 300
"""Resolution, pixels per inch."""
PAGE = (0.210, 0.297)
"""Width and height of a page, m."""
COUNT, EACH = 8, 4
"""Number of tags, and number of tags on one page."""
RULER = 0.1
"""Length of the line for a check of a print's scale, m."""


def _pixels(metres: float) -> int:
    return round(metres / 0.0254 * DPI)


def _page() -> Image.Image:
    """Return an empty page with a ruler."""
    page = Image.new("L", (_pixels(PAGE[0]), _pixels(PAGE[1])), 255)
    pen = ImageDraw.Draw(page)
    x, y = _pixels(0.02), _pixels(PAGE[1] - 0.012)
    pen.line((x, y, x + _pixels(RULER), y), 0, 4)
    for end in (x, x + _pixels(RULER)):
        pen.line((end, y - 20, end, y + 20), 0, 4)
    note = f"must be {1e3 * RULER:.0f} mm; if not, print at 100 % scale"
    pen.text((x + _pixels(RULER) + 30, y - 24), note, 0, font_size=40)
    return page


def _paste(page: Image.Image, image: Array, x: float, y: float, note: str) -> None:
    """Put an image with a note below it at (x, y), m from the upper left corner."""
    page.paste(Image.fromarray(image), (_pixels(x), _pixels(y)))
    below = _pixels(x), _pixels(y) + image.shape[0] + 30
    ImageDraw.Draw(page).text(below, note, 0, font_size=40)


def write_sheets(folder: Path) -> list[Path]:
    """Write ``tags.pdf`` and ``charuco.pdf`` into a folder and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    markers, size = cv2.aruco.getPredefinedDictionary(TAGS), _pixels(TAG)
    pages = []
    for first in range(0, COUNT, EACH):
        page = _page()
        for k in range(EACH):
            tag = cv2.aruco.generateImageMarker(markers, first + k, size)
            corner = 0.018 + 0.096 * (k % 2), 0.02 + 0.12 * (k // 2)
            _paste(page, np.asarray(tag), *corner, f"tag {first + k}")
        pages.append(page)
    tags = folder / "tags.pdf"
    pages[0].save(tags, resolution=DPI, save_all=True, append_images=pages[1:])
    page, (along, across) = _page(), SQUARES
    shape = _pixels(along * SQUARE), _pixels(across * SQUARE)
    drawn = np.rot90(make_board().generateImage(shape))
    note = f"ChArUco {along} x {across}, {1e3 * SQUARE:.0f} / {1e3 * MARKER:.0f} mm"
    _paste(page, np.ascontiguousarray(drawn), 0.014, 0.015, note)
    board = folder / "charuco.pdf"
    page.save(board, resolution=DPI)
    return [tags, board]
