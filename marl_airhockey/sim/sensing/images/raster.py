"""Compiled drawing of filled shapes whose edges are anti-aliased by their coverage.

Pixel (x, y) covers the square from (x, y) to (x + 1, y + 1), and y points down. The
numbers need only the basic operations and square roots, so that they are the same on
every machine.
"""

from __future__ import annotations

import math

import numpy as np

from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array

LINES = 16
"""Number of lines on which the coverage of a row of pixels is computed. Along a line,
it is exact."""
ORDER = (0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15)
"""Moment of the exposure at which each of these lines is evaluated. Neighbouring lines
have moments that are far apart (van der Corput, 1935)."""
CORNERS = 4
"""Largest number of points of a shape that moves."""
FAR = 1e6
"""Coordinates from which on shapes are not painted, pixels."""


@inner(error_model="numpy")
def span(
    points: Array, count: int, radius: float, edges: Array, sides: int, y: float
) -> tuple[float, float]:
    """Return where a line at ``y`` enters and leaves a convex shape.

    The shape is the union of discs around the first points and of a polygon.
    """
    low, high = 1e9, -1e9
    if count < 3:
        for k in range(count):
            across = y - points[k, 1]
            half = radius * radius - across * across
            if half > 0.0:
                half = math.sqrt(half)
                low = min(low, points[k, 0] - half)
                high = max(high, points[k, 0] + half)
    for k in range(sides):
        ax, ay = edges[k, 0], edges[k, 1]
        bx, by = edges[(k + 1) % sides, 0], edges[(k + 1) % sides, 1]
        if (ay <= y) != (by <= y):
            x = ax + (y - ay) * (bx - ax) / (by - ay)
            low, high = min(low, x), max(high, x)
    return low, high


@inner(error_model="numpy")
def add(cover: Array, low: float, high: float, sign: float) -> None:
    """Add a span to the changes of the coverage from one pixel to the next."""
    edge = float(len(cover) - 2)
    for x, weight in ((low, sign), (high, -sign)):
        inside = min(max(x, 0.0), edge)
        k = int(inside)
        part = weight * (inside - k)
        cover[k] += weight - part
        cover[k + 1] += part


@inner(error_model="numpy")
def band(points: Array, half: float, edges: Array) -> int:
    """Fill in the corners of a line without its round ends; return their number.

    Args:
        points: Ends of the line (2 or more, 2), pixels.
        half: Half of the width, pixels.
        edges: Corners (4 or more, 2), which are overwritten.
    """
    dx, dy = points[1, 0] - points[0, 0], points[1, 1] - points[0, 1]
    size = math.sqrt(dx * dx + dy * dy)
    if size <= 0.0:
        return 0
    ux, uy = -dy / size * half, dx / size * half
    for k in range(4):
        end, sign = (k + 1) // 2 % 2, 1.0 if k < 2 else -1.0
        edges[k, 0] = points[end, 0] + sign * ux
        edges[k, 1] = points[end, 1] + sign * uy
    return 4


@inner(error_model="numpy")
def paint(
    image: Array,
    first: int,
    last: int,
    points: Array,
    count: int,
    outer: float,
    inside: float,
    colour: Array,
    fill: Array,
    rounding: float,
    edges: Array,
    cover: Array,
    hole: Array,
    opacity: float = 1.0,
    right_by: float = 0.0,
    down_by: float = 0.0,
) -> None:
    """Draw a shape into channels ``first`` to ``last`` of an image (H, W, channels).

    Args:
        image: Image, whose values are numbers of any type.
        first: First channel.
        last: End of the channels. They take the values of ``colour`` in turn.
        points: Points of the shape (K, 2), K at least CORNERS, pixels.
        count: Number of points: 1 for a disc, 2 for a line, else a convex polygon.
        outer: Radius of a disc, or half the width of a line, pixels.
        inside: Radius of the inner part of a disc, pixels.
        colour: Values of the channels.
        fill: Values of the channels in the inner part; nan if it is transparent.
        rounding: 0.5 to round the values to whole numbers, else 0.
        edges: Scratch space (K, 2).
        cover: Scratch space (W + 2,).
        hole: Scratch space (W + 2,).
        opacity: Opacity of the shape, 0 to 1.
        right_by: Motion of the shape to the right during an exposure, pixels.
        down_by: Motion of the shape down during an exposure, pixels.
    """
    height, width = image.shape[0], image.shape[1]
    sides, grown = 0, outer if count < 3 else 0.0
    if count == 2:
        sides = band(points, outer, edges)
    elif count > 2:
        sides = count
        edges[:count] = points[:count]
    low_x = high_x = points[0, 0]
    low_y = high_y = points[0, 1]
    far = 0.0
    for k in range(count):
        far += abs(points[k, 0]) + abs(points[k, 1])
        low_x, high_x = min(low_x, points[k, 0]), max(high_x, points[k, 0])
        low_y, high_y = min(low_y, points[k, 1]), max(high_y, points[k, 1])
    if not far < FAR:
        return
    wide, high = grown + 0.5 * abs(right_by), grown + 0.5 * abs(down_by)
    left = max(math.floor(low_x - wide), 0)
    right = min(math.ceil(high_x + wide) + 1, width)
    for y in range(
        max(math.floor(low_y - high), 0),
        min(math.ceil(high_y + high), height),
    ):
        for x in range(left, right + 2):
            cover[x] = hole[x] = 0.0
        for k in range(LINES):
            when = (ORDER[k] + 0.5) / LINES - 0.5
            line = y + (k + 0.5) / LINES - when * down_by
            start, end = span(points, count, outer, edges, sides, line)
            if start < end:
                add(cover, start + when * right_by, end + when * right_by, 1.0)
            if inside > 0.0:
                start, end = span(points, 1, inside, edges, 0, line)
                if start < end:
                    add(hole, start + when * right_by, end + when * right_by, 1.0)
        total = within = 0.0
        for x in range(left, right):
            total += opacity * cover[x] / LINES
            within += opacity * hole[x] / LINES
            if total > 1e-6:
                for c in range(first, last):
                    k = (c - first) % len(colour)
                    old = float(image[y, x, c])
                    new = old + (colour[k] - old) * (total - within)
                    if inside > 0.0 and not math.isnan(fill[k]):
                        new += (fill[k] - old) * within
                    image[y, x, c] = new + rounding


@compiled(error_model="numpy")
def paint_all(
    images: Array,
    points: Array,
    shown: Array,
    count: Array,
    outer: Array,
    inside: Array,
    colours: Array,
    fills: Array,
    channels: Array,
    rounding: float,
) -> None:
    """Draw n shapes into each of B images.

    Args:
        images: Images (B, H, W, channels).
        points: Points (B, n, K, 2) of the shapes, K at least CORNERS, pixels; the other
            arguments are the same for all images.
        shown: Opacity of the shapes (B, n), 0 to 1.
        count: Number of points (n,).
        outer: Radius, or half the width of a line, (n,), pixels.
        inside: Radius of the inner part of a disc (n,), pixels.
        colours: Values of the channels (n, C).
        fills: Values of the channels in the inner part (n, C).
        channels: First and last channel (n, 2).
        rounding: 0.5 to round the values to whole numbers, else 0.
    """
    edges, wide = np.zeros((points.shape[2], 2)), images.shape[2] + 2
    cover, hole = np.zeros(wide), np.zeros(wide)
    for b in range(images.shape[0]):
        for k in range(len(count)):
            if shown[b, k] == 0.0:
                continue
            paint(
                images[b],
                channels[k, 0],
                channels[k, 1],
                points[b, k],
                count[k],
                outer[k],
                inside[k],
                colours[k],
                fills[k],
                rounding,
                edges,
                cover,
                hole,
                shown[b, k],
            )
