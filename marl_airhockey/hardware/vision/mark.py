"""Orientation of a puck with a mark: a bar of another colour through its centre."""

from __future__ import annotations

import cv2
import numpy as np

from marl_airhockey.hardware.vision.colour import Colour
from marl_airhockey.hardware.vision.lens import CameraView
from marl_airhockey.types import Array

LENGTH, WIDTH = 1.2, 0.3
"""Length and width of the bar, in radii of the puck. The rim keeps the puck's colour,
so that the puck is found as one area."""
RINGS = (0.3, 0.42, 0.54)
"""Radii of the circles on which the colour is read, in radii of the puck."""
POINTS = 24
"""Number of points on each circle."""
CLEAR = 0.12
"""Least contrast of a mark: amplitude of the second harmonic of the colour around the
centre, as a share of its mean. In the virtual lab it is at most 0.01 without a
mark, and at least 0.2 with a mark and up to 2 m/s."""
NOISE = 0.025
"""Standard deviation of an orientation, rad: 0.018 to 0.024 in the virtual lab, with a
puck of 18 px and up to 2 m/s. `tests/hardware/test_vision.py` measures it."""
_ANGLES = 2.0 * np.pi * np.arange(POINTS) / POINTS
_CIRCLES = np.concatenate(
    [r * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)]) for r in RINGS]
)
_WAVES = np.tile(np.exp(2j * _ANGLES), len(RINGS))


def orientation_of(
    image: Array,
    view: CameraView,
    colour: Colour,
    place: Array,
    radius: float,
    height: float,
) -> float:
    """Return the orientation of a mark, rad, modulo pi; nan if there is none.

    Args:
        image: Image (H, W, 3).
        view: View of the camera.
        colour: Colour of the puck.
        place: Position (2,) of the puck's centre, table frame, m.
        radius: Radius of the puck, m.
        height: Height of the puck's top above the table, m.
    """
    flat = place + radius * _CIRCLES
    pixels = view.project(np.column_stack([flat, np.full(len(flat), height)]))
    low = np.floor(pixels.min(0)).astype(int) - 1
    high = np.ceil(pixels.max(0)).astype(int) + 2
    if (low < 0).any() or (high > image.shape[1::-1]).any():
        return float("nan")
    amount = colour.amount(image[low[1] : high[1], low[0] : high[0]])
    x, y = (pixels - low).astype(np.float32).T
    read = cv2.remap(amount, x[None], y[None], cv2.INTER_LINEAR)[0]
    wave = complex(read @ _WAVES) / len(read)
    if abs(wave) < CLEAR * max(float(read.mean()), 1.0):
        return float("nan")
    # The colour is weakest along the bar.
    return float(np.angle(-wave) / 2.0)
