"""Compiled drawing of what moves: sprites of bodies, and other shapes."""

from __future__ import annotations

import math

import numpy as np

from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.sensing.images.raster import CORNERS, FAR, paint
from marl_airhockey.types import Array

PHASES = 96
"""Number of positions of a body in a pixel along each axis for which sprites exist."""
OPAQUE = 1 << 15
"""Opacity of a sprite that hides what is below it."""
FINE = OPAQUE >> 8
"""Number of steps of a colour of a sprite from one grey level to the next."""


@inner(error_model="numpy")
def stamp(
    image: Array,
    first: int,
    channels: int,
    x: float,
    y: float,
    sprites: Array,
    start: int,
    size: int,
) -> None:
    """Draw the sprite of a body at (x, y), pixels, into some channels of an image."""
    if not abs(x) + abs(y) < FAR:
        return
    left, top = math.floor(x), math.floor(y)
    down = min(int((y - top) * PHASES), PHASES - 1)
    phase = down * PHASES + min(int((x - left) * PHASES), PHASES - 1)
    start += phase * size * size * (channels + 1)
    left, top = left - size // 2, top - size // 2
    for row in range(size):
        if 0 <= top + row < image.shape[0]:
            for column in range(size):
                at = start + (row * size + column) * (channels + 1)
                hidden = OPAQUE - np.int64(sprites[at + channels])
                if hidden != OPAQUE and 0 <= left + column < image.shape[1]:
                    for c in range(channels):
                        old = np.int64(image[top + row, left + column, first + c])
                        new = np.int64(sprites[at + c]) * (OPAQUE // FINE)
                        image[top + row, left + column, first + c] = (
                            new + old * hidden + OPAQUE // 2
                        ) // OPAQUE


@compiled(nogil=True, error_model="numpy")
def render(
    out: Array,
    views: Array,
    frames: Array,
    order: Array,
    kinds: Array,
    sprites: Array,
    places: Array,
    points: Array,
    shown: Array,
    count: Array,
    outer: Array,
    inside: Array,
    colours: Array,
    fills: Array,
    channels: Array,
    below: int,
) -> None:
    """Draw what moves into the observations of S seats in W worlds.

    Args:
        out: Images of the tables (W, S, H, W, F * C), uint8, which are painted.
        views: Conversions (S, 2, 3) from table frame, m, to pixels.
        frames: Positions (W, F, N, 3) of all bodies, m, and their angles.
        order: Indices of the bodies that have sprites, the lowest first.
        kinds: Index of the sprite of each body (S, N).
        sprites: Sprites of all kinds, uint16.
        places: Start in ``sprites`` and size, pixels, of each kind (kinds, 2).
        points: Points (W, n, CORNERS, 2) of other shapes, table frame, m.
        shown: Visibility (W, n) of these shapes, 1 or 0.
        count: Number of points (n,).
        outer: Radius, or half the width of a line, (n,), pixels.
        inside: Radius of the inner part of a disc (n,), pixels.
        colours: Values of the channels (n, C).
        fills: Values of the channels in the inner part (n, C).
        channels: First and last channel (n, 2) of the shapes.
        below: Number of shapes that bodies cover; they are the first ones.
    """
    worlds, seats, depth = out.shape[0], out.shape[1], colours.shape[1]
    edges, corners = np.zeros((CORNERS, 2)), np.zeros((CORNERS, 2))
    cover, hole = np.zeros(out.shape[3] + 2), np.zeros(out.shape[3] + 2)
    for b in range(worlds):
        for s in range(seats):
            image, view = out[b, s], views[s]
            for k in range(len(count) + 1):
                if k == below:
                    for f in range(frames.shape[1]):
                        for body in order:
                            x, y = frames[b, f, body, 0], frames[b, f, body, 1]
                            stamp(
                                image,
                                f * depth,
                                depth,
                                view[0, 0] * x + view[0, 1] * y + view[0, 2],
                                view[1, 0] * x + view[1, 1] * y + view[1, 2],
                                sprites,
                                places[kinds[s, body], 0],
                                places[kinds[s, body], 1],
                            )
                if k == len(count):
                    break
                if shown[b, k] == 0.0:
                    continue
                for i in range(count[k]):
                    x, y = points[b, k, i, 0], points[b, k, i, 1]
                    for axis in range(2):
                        corners[i, axis] = (
                            view[axis, 0] * x + view[axis, 1] * y + view[axis, 2]
                        )
                paint(
                    image,
                    channels[k, 0],
                    channels[k, 1],
                    corners,
                    count[k],
                    outer[k],
                    inside[k],
                    colours[k],
                    fills[k],
                    0.5,
                    edges,
                    cover,
                    hole,
                )
