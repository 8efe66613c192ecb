"""Refinement of clicked corners of a table by the edges between them."""

from __future__ import annotations

import cv2
import numpy as np

from marl_airhockey.hardware.vision.lens import Lens
from marl_airhockey.types import Array

SAMPLES = 80
"""Number of points along an edge at which it is searched."""
ACROSS = 6.0
"""Largest distance of the search from the clicked line, px."""
FINE = 0.25
"""Distance between two samples of the search, px."""
BORDER = 0.04
"""Share of an edge at either end that is ignored, as corners are round."""
OUTLIER = 1.0
"""Least distance from a line, px, at which a point may be an outlier."""
FEWEST = 20
"""Least number of points on a line."""


def refine_corners(image: Array, clicks: Array, lens: Lens) -> Array:
    """Return the corners (n, 2), px, in which the edges of a table meet.

    Args:
        image: Image (H, W, 3) uint8, blue, green, red.
        clicks: Clicked corners (n, 2), px, in order around the table.
        lens: Lens of the camera.

    Raises:
        ValueError: An edge is not seen. The message gives its corners.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0).astype(np.float32)
    lines = [
        _line(smooth, clicks[k], clicks[(k + 1) % len(clicks)], lens, k)
        for k in range(len(clicks))
    ]
    met = [np.cross(lines[k - 1], lines[k]) for k in range(len(lines))]
    rays = np.array([point / point[2] for point in met])
    seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), *lens.arrays)
    return np.asarray(seen.reshape(-1, 2))


def _line(image: Array, start: Array, end: Array, lens: Lens, k: int) -> Array:
    """Return a line (3,) through an edge, in normalized undistorted coordinates."""
    matrix, distortion = lens.arrays
    ends = cv2.undistortPoints(
        np.array([start, end], float).reshape(-1, 1, 2), matrix, distortion
    ).reshape(-1, 2)
    along = np.linspace(BORDER, 1.0 - BORDER, SAMPLES)[:, None]
    middle = ends[0] + along * (ends[1] - ends[0])
    tangent = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    normal = np.array([-tangent[1], tangent[0]])
    offsets = np.arange(-ACROSS, ACROSS + FINE, FINE) / matrix[0, 0]
    points = middle[:, None] + offsets[None, :, None] * normal
    rays = np.concatenate([points, np.ones((*points.shape[:2], 1))], -1).reshape(-1, 3)
    pixels, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, distortion)
    at = pixels.reshape(*points.shape).astype(np.float32)
    shown = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    slopes = np.abs(np.gradient(shown, axis=1))
    # The centre of the slope is exact to 0.1 px, its steepest pixel is not.
    best = slopes.argmax(1)
    near = np.abs(np.arange(len(offsets)) - best[:, None]) * FINE <= 2.0
    weights = np.where(near, slopes, 0.0)
    found = (weights * offsets).sum(1) / np.maximum(weights.sum(1), 1e-9)
    good = slopes.max(1) > 0.5 * np.median(slopes.max(1))
    position = along[:, 0]
    for _ in range(4):
        if good.sum() < FEWEST:
            raise ValueError(
                f"the edge between corners {k + 1} and {k + 2} is not seen; click "
                "where the playing field meets the rail, or measure the tags again"
            )
        slope, offset = np.polyfit(position[good], found[good], 1)
        off = np.abs(found - offset - slope * position) * matrix[0, 0]
        good &= off < max(OUTLIER, 2.0 * float(np.median(off[good])))
    first = ends[0] + offset * normal
    last = ends[1] + (offset + slope) * normal
    return np.cross([*first, 1.0], [*last, 1.0])
