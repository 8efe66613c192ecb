"""Drawing of the objects in front of the lab's cameras."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from marl_airhockey.hardware.vision.calibration import tag_corners
from marl_airhockey.hardware.vision.lens import CameraView, Lens
from marl_airhockey.types import Array

SHIFT = 4
"""Fractional bits of the pixel coordinates of edges."""
OVER, MARGIN = 3, 80
"""Oversampling factor of drawn scenes, and their margin, px."""


def enlarged(view: CameraView) -> CameraView:
    """Return the larger view without distortion that is used to draw scenes."""
    width, height = view.lens.size
    larger = view.lens.arrays[0].copy()
    larger[:2, 2] += MARGIN
    larger[:2] *= OVER
    size = OVER * (width + 2 * MARGIN), OVER * (height + 2 * MARGIN)
    rows = tuple(tuple(float(x) for x in row) for row in larger)
    return replace(view, lens=Lens(rows, (0.0,) * 5, size))  # type: ignore[arg-type]


def through_lens(view: CameraView, scene: Array) -> Array:
    """Return a scene of the `enlarged` view as an image (H, W, 3) of a view."""
    width, height = view.lens.size
    matrix, distortion = view.lens.arrays
    larger = enlarged(view).lens.arrays[0]
    grid = np.mgrid[0:width, 0:height].T.reshape(-1, 1, 2).astype(float)
    seen = cv2.undistortPoints(grid, matrix, distortion, P=larger)
    across = seen.reshape(height, width, 2).astype(np.float32)
    small = cv2.GaussianBlur(scene, (0, 0), 0.6 * OVER)
    columns: Any = np.ascontiguousarray(across[..., 0])
    rows_seen: Any = np.ascontiguousarray(across[..., 1])
    through = cv2.remap(small, columns, rows_seen, cv2.INTER_LINEAR)
    return np.asarray(through, np.float32)


def draw_polygon(image: Array, pixels: Array, colour: tuple[int, int, int]) -> None:
    """Fill a convex polygon (n, 2), px, in a frame with a colour in RGB."""
    # OpenCV paints pixels on the edge completely, so move every edge inward by 0.5 px.
    corners = np.round(_inset(pixels, 0.5) * 2**SHIFT).astype(np.int32)
    cv2.fillPoly(image, [corners], colour[::-1], cv2.LINE_AA, SHIFT)


def _inset(corners: Array, distance: float) -> Array:
    """Return the corners (n, 2) of a convex polygon whose edges are moved inward."""
    along = np.roll(corners, -1, axis=0) - corners
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    left = np.stack([-along[:, 1], along[:, 0]], 1)
    before = np.roll(left, 1, axis=0)
    side = np.sign(np.sum(left * (corners.mean(0) - corners)))
    both = (before + left) / (1.0 + (before * left).sum(1, keepdims=True))
    return np.asarray(corners + side * distance * both)


def fill(
    image: Array,
    view: CameraView,
    corners: Array,
    height: float,
    colour: tuple[int, int, int],
    corner: tuple[int, int] = (0, 0),
) -> None:
    """Fill a polygon at a height above the table.

    Args:
        image: Image (h, w, 3) that is drawn on.
        view: View of the whole image.
        corners: Corners (n, 2), table frame, m.
        height: Height above the table, m.
        colour: Colour in RGB.
        corner: Upper left pixel (x, y) of ``image`` in the whole image.
    """
    points = np.column_stack([corners, np.full(len(corners), height)])
    draw_polygon(image, view.project(points) - corner, colour)


def shade(
    image: Array, view: CameraView, corners: Array, corner: tuple[int, int]
) -> None:
    """Darken a polygon (n, 2), table frame, m, as a shadow."""
    drawn = np.zeros(image.shape[:2], np.uint8)
    points = np.column_stack([corners, np.zeros(len(corners))])
    pixels = np.round((view.project(points) - corner) * 2**SHIFT).astype(np.int32)
    cv2.fillPoly(drawn, [pixels], 255, cv2.LINE_AA, SHIFT)
    shadow = np.asarray(cv2.GaussianBlur(drawn, (0, 0), 2.0), np.float32)
    dark = 1.0 - 0.25 * (shadow / 255)
    image[:] = (image * dark[..., None]).astype(np.uint8)


def paste_tag(image: Array, view: CameraView, number: int, place: Array) -> None:
    """Draw a printed tag with a white rim at a position (2,), table frame, m."""
    rim = place + 1.4 * (tag_corners(place) - place)
    fill(image, view, rim, 0.0, (250, 250, 250))
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    size = 240
    tag = cv2.aruco.generateImageMarker(markers, number, size)
    flat = np.array([(0, 0), (size, 0), (size, size), (0, size)], np.float32) - 0.5
    corners = tag_corners(place)
    pixels = view.project(np.column_stack([corners, np.zeros(4)])).astype(np.float32)
    warp = cv2.getPerspectiveTransform(flat, pixels)
    shape = image.shape[1], image.shape[0]
    drawn = cv2.warpPerspective(tag, warp, shape, flags=cv2.INTER_AREA)
    inside = cv2.warpPerspective(np.full_like(tag, 255), warp, shape)
    image[inside > 127] = drawn[inside > 127][:, None]
