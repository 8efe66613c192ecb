"""Compiled drawing of what a camera sees: bodies with motion blur, and an arm."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.camera_model import project
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.sim.sensing.images.raster import paint
from marl_airhockey.types import Array

SIDES = 12
"""Number of corners of a polygon that replaces a disc."""
_ANGLES = (np.arange(SIDES) + 0.5) * 2.0 * np.pi / SIDES
_SAME_AREA = float(np.sqrt(2.0 * np.pi / SIDES / sin(2.0 * np.pi / SIDES)))
CIRCLE = _SAME_AREA * np.stack([cos(_ANGLES), sin(_ANGLES)], 1)
"""Corners (SIDES, 2) of a polygon with the area of the unit disc."""
LINK = ((-0.02, 0.035), (-0.02, -0.035), (0.45, -0.06), (0.45, 0.06))
"""Corners of an arm's last link: distances from the paddle toward the base, and to the
side, m."""
LINK_HEIGHTS = (0.10, 0.10, 0.35, 0.35)
"""Heights of these corners above the table, m."""


class Silhouettes(NamedTuple):
    """Sizes and colours of the bodies and of the arm in the images of a camera."""

    order: Array
    """Indices of the bodies, the lowest first."""
    radii: Array
    """Radius of each body, or half the width of a square (N,), m."""
    squares: Array
    """True for square bodies (N,)."""
    heights: Array
    """Height of the top of each body (N,), m."""
    colours: Array
    """Values of the channels of each body (N, C)."""
    arms: int
    """Number of paddles that an arm holds; they are the first bodies."""
    base: Array
    """Position of the arm's base (2,), m."""
    arm: Array
    """Values of the channels of the arm (C,)."""
    exposure: float
    """Exposure time, s."""


@inner(error_model="numpy")
def link(paddle_x: float, paddle_y: float, base: Array, corners: Array) -> None:
    """Fill in the corners (4, 3), m, of the last link of an arm that holds a paddle."""
    x, y = base[0] - paddle_x, base[1] - paddle_y
    size = math.sqrt(x * x + y * y)
    x, y = x / size, y / size
    for k in range(4):
        along, aside = LINK[k]
        corners[k, 0] = paddle_x + along * x - aside * y
        corners[k, 1] = paddle_y + along * y + aside * x
        corners[k, 2] = LINK_HEIGHTS[k]


@inner(error_model="numpy")
def outline(body: Array, radius: float, square: bool, corners: Array) -> None:
    """Fill in the corners (SIDES, 2), m, of the outline of a body.

    Args:
        body: Position, m, velocity, m/s, and angle, rad, (5,).
        radius: Radius of a disc, or half the width of a square, m.
        square: True for a square, each corner of which occurs several times.
        corners: Corners, which are overwritten.
    """
    c, s = 1.0, 0.0
    if square:
        c, s = cos(body[4]), sin(body[4])
    for k in range(SIDES):
        x, y = CIRCLE[k, 0], CIRCLE[k, 1]
        if square:
            x, y = math.copysign(1.0, x), math.copysign(1.0, y)
        corners[k, 0] = body[0] + radius * (c * x - s * y)
        corners[k, 1] = body[1] + radius * (s * x + c * y)


@inner(error_model="numpy")
def to_pixels(
    points: Array, count: int, numbers: Array, window: Array, pixels: Array
) -> None:
    """Convert the first points (n, 3), m, to pixels (n, 2) of an image.

    Args:
        points: Points, table frame, m.
        count: Number of points that are converted.
        numbers: Numbers of the camera, see `CameraModel.numbers`.
        window: Left and upper end, px, and scale, of the image in the frame (3,).
        pixels: Pixels, which are overwritten.
    """
    for k in range(count):
        x, y = project(numbers, points[k, 0], points[k, 1], points[k, 2])
        pixels[k, 0] = (x + 0.5 - window[0]) * window[2]
        pixels[k, 1] = (y + 0.5 - window[1]) * window[2]


@compiled(nogil=True, error_model="numpy")
def photograph(
    out: Array, numbers: Array, window: Array, photos: Array, look: Silhouettes
) -> None:
    """Draw the bodies and the arm into the images of a camera in W worlds.

    Args:
        out: Images of the table (W, H, W, F * C), uint8, which are painted.
        numbers: Numbers of the camera, see `CameraModel.numbers`.
        window: Left and upper end, px, and scale, of the images in the frames (3,).
        photos: Positions, m, velocities, m/s, and angles of all bodies in the frames
            (W, F, N, 5).
        look: Sizes and colours.
    """
    depth, size = look.colours.shape[1], out.shape[2]
    places, pixels = np.zeros((SIDES, 3)), np.zeros((SIDES, 2))
    ahead = np.zeros((1, 2))
    edges, clear = np.zeros((SIDES, 2)), np.full(depth, np.nan)
    cover, hole = np.zeros(size + 2), np.zeros(size + 2)
    for b in range(len(out)):
        for f in range(photos.shape[1]):
            first, last = f * depth, (f + 1) * depth
            for k in look.order:
                body = photos[b, f, k]
                outline(body, look.radii[k], look.squares[k], places)
                places[:, 2] = look.heights[k]
                to_pixels(places, SIDES, numbers, window, pixels)
                x, y = pixels[0, 0], pixels[0, 1]
                places[0, 0] += look.exposure * body[2]
                places[0, 1] += look.exposure * body[3]
                to_pixels(places, 1, numbers, window, ahead)
                paint(
                    out[b],
                    first,
                    last,
                    pixels,
                    SIDES,
                    0.0,
                    0.0,
                    look.colours[k],
                    clear,
                    0.5,
                    edges,
                    cover,
                    hole,
                    1.0,
                    ahead[0, 0] - x,
                    ahead[0, 1] - y,
                )
            for k in range(look.arms):
                link(photos[b, f, k, 0], photos[b, f, k, 1], look.base, places)
                to_pixels(places, 4, numbers, window, pixels)
                paint(
                    out[b],
                    first,
                    last,
                    pixels,
                    4,
                    0.0,
                    0.0,
                    look.arm,
                    clear,
                    0.5,
                    edges,
                    cover,
                    hole,
                )
