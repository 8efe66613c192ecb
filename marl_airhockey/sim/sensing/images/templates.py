"""Templates of images: tables without bodies, and sprites of bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from marl_airhockey.sim.contracts.image_form import ImageForm
from marl_airhockey.sim.contracts.look import (
    FRAME,
    ROOM,
    Colour,
    Shape,
    body_shapes,
    drawn_bodies,
    table_shapes,
)
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.sensing.images.drawing import FINE, OPAQUE, PHASES
from marl_airhockey.sim.sensing.images.raster import CORNERS, paint_all
from marl_airhockey.types import Array

USUAL_WIDTH = 880.0
"""Width of the images in whose pixels lines are measured, pixels."""
SMOOTH = 16
"""Factor by which a table is painted larger than it is shown."""
LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in a grey level, as of BT.601."""


@dataclass(frozen=True)
class Outlines:
    """Static properties of n shapes that consist of discs, lines and polygons."""

    count: Array
    """Number of points (n,)."""
    outer: Array
    """Radius, or half the width of a line, (n,), pixels."""
    inside: Array
    """Radius of the inner part of a disc (n,), pixels."""
    colours: Array
    """Values of the channels (n, C)."""
    fills: Array
    """Values of the channels in the inner part (n, C); nan if it is transparent."""


@dataclass(frozen=True)
class Templates:
    """Templates of the images of all seats of a scene."""

    backgrounds: Array
    """Tables (seats, H, W, F * C), uint8."""
    views: Array
    """Conversions (seats, 2, 3) from table frame, m, to pixels."""
    order: Array
    """Indices of the bodies that have sprites, the lowest first."""
    kinds: Array
    """Index of the sprite of each body (seats, bodies)."""
    sprites: Array
    """Sprites of all kinds, uint16."""
    places: Array
    """Start in ``sprites`` and size, pixels, of each kind (kinds, 2)."""


def simple(shapes: Iterable[Shape]) -> list[Shape]:
    """Return shapes whose outlined polygons are replaced by lines."""
    found = []
    for shape in shapes:
        corners = shape.points.shape[-2]
        if shape.line and corners > 2:
            for k in range(corners):
                ends = np.stack(
                    [shape.points[..., i % corners, :] for i in (k, k + 1)], -2
                )
                line = shape.line
                found.append(Shape(ends, shape.colour, line=line, shown=shape.shown))
        else:
            found.append(shape)
    return found


def tones(colour: Colour, form: ImageForm) -> Array:
    """Return the values of the channels of a colour (C,)."""
    channels = np.array(colour, np.float64)
    return channels if form.channels == 3 else (channels * LUMA).sum(keepdims=True)


def outlines(shapes: Sequence[Shape], scale: float, form: ImageForm) -> Outlines:
    """Return the static properties of simple shapes; ``scale`` is in pixels/m."""
    count = np.array([s.points.shape[-2] for s in shapes], np.int64)
    half = np.array([s.line / 2 * form.size / USUAL_WIDTH for s in shapes])
    radius = np.array([s.radius * scale for s in shapes])
    ring = (half > 0) & (count == 1)
    inside = np.where(ring, np.maximum(radius - half, 0.0), 0.0)
    clear = np.full(form.channels, np.nan)
    tone = [tones(s.colour, form) for s in shapes]
    fill = [clear if s.fill is None else tones(s.fill, form) for s in shapes]
    colours, fills = (np.array(c).reshape(-1, form.channels) for c in (tone, fill))
    return Outlines(count, np.asarray(radius + half), inside, colours, fills)


def padded(points: Array, number: int = CORNERS) -> Array:
    """Return the points (..., K, 2) of a shape, with the last one repeated."""
    last = [points[..., -1:, :]] * (number - points.shape[-2])
    return np.concatenate([points, *last], -2)


def scale_of(scene: Scene, form: ImageForm) -> float:
    """Return the scale of images, pixels/m: each ego frame shows the whole rail."""
    corners = np.asarray(scene.table.vertices)
    sides = {seat.side for seat in scene.seats}
    rotated = [products(corners, scene.table.rotation(side)) for side in sides]
    return float(form.size / 2 / (np.abs(rotated).max() + FRAME))


@lru_cache(maxsize=8)
def templates(scene: Scene, form: ImageForm) -> Templates:
    """Return the templates of a scene."""
    seats, scale = range(len(scene.seats)), scale_of(scene, form)
    views = np.array([_view(scene, seat, scale, form) for seat in seats])
    backgrounds = [_background(scene, views[seat], seat, form) for seat in seats]
    order = drawn_bodies(scene)
    if scene.block_shape == "square":
        blocks = range(scene.bodies.block.start, scene.bodies.block.stop)
        order = [k for k in order if k not in blocks]
    parts: dict[tuple[tuple[Colour | None, float, float], ...], int] = {}
    kinds = np.zeros((len(seats), len(scene.bodies)), np.int64)
    sprites, places, start = [np.zeros(0, np.uint16)], [], 0
    for seat, body in product(seats, order):
        shapes = body_shapes(scene, body, np.zeros(2), np.zeros(()), seat)
        key = tuple((s.colour, s.radius, s.line) for s in shapes)
        if key not in parts:
            parts[key] = len(parts)
            sprite, size = _sprite(shapes, scale, form)
            sprites.append(sprite)
            places.append((start, size))
            start += len(sprite)
        kinds[seat, body] = parts[key]
    return Templates(
        np.array(backgrounds),
        views,
        np.array(order, np.int64),
        kinds,
        np.concatenate(sprites),
        np.array(places, np.int64).reshape(-1, 2),
    )


def _view(scene: Scene, seat: int, scale: float, form: ImageForm) -> Array:
    """Return the conversion (2, 3) from table frame to the pixels of a seat."""
    x, y = scale * scene.table.rotation(scene.seats[seat].side)
    middle = form.size / 2
    return np.array([[*x, middle], [*-y, middle]])


def _background(scene: Scene, view: Array, seat: int, form: ImageForm) -> Array:
    """Return a table as a seat sees it (H, W, F * C), uint8."""
    shapes = simple(table_shapes(scene, seat))
    found = outlines(shapes, scale_of(scene, form), form)
    corners = max(CORNERS, *found.count)
    points = np.array([padded(shape.points, corners) for shape in shapes])
    pixels = SMOOTH * (products(points, view[:, :2]) + view[:, 2])
    # The edges of neighbouring shapes would show through each other at this size.
    size, channels = SMOOTH * form.size, form.channels
    image = np.empty((1, size, size, channels), np.uint8)
    image[:] = np.round(tones(ROOM, form))
    draw(image, pixels[None], found, SMOOTH, 0.5)
    blocks = image.reshape(form.size, SMOOTH, form.size, SMOOTH, channels)
    small = np.round(blocks.mean((1, 3))).astype(np.uint8)
    return np.tile(small, form.frames)


def draw(
    images: Array, points: Array, found: Outlines, larger: float, rounding: float
) -> None:
    """Draw n shapes into all channels of images (B, H, W, channels).

    Args:
        images: Images that are painted.
        points: Points (B, n, K, 2), pixels.
        found: Properties of the shapes.
        larger: Factor of their radii and widths.
        rounding: 0.5 to round the values to whole numbers, else 0.
    """
    channels = np.tile([0, images.shape[3]], (len(found.count), 1))
    radii = larger * found.outer, larger * found.inside
    colours = found.colours, found.fills
    shown = np.ones(points.shape[:2])
    paint_all(images, points, shown, found.count, *radii, *colours, channels, rounding)


def _sprite(
    shapes: Sequence[Shape], scale: float, form: ImageForm
) -> tuple[Array, int]:
    """Return the sprite of concentric discs at all phases, flat, and its size, pixels.

    It is the sum of the coverages of the rings between their edges, so that no edge
    shows through another one.
    """
    found = outlines(shapes, scale, form)
    radii = np.stack([found.outer, found.inside], -1).ravel()
    inside = np.where(np.isnan(found.fills), found.colours, found.fills)
    colours = np.stack([found.colours, inside], 1).reshape(-1, form.channels)
    rings = len(radii)
    margin = int(np.ceil(radii.max()))
    size, steps = 2 * margin + 1, margin + (np.arange(PHASES) + 0.5) / PHASES
    y, x = np.meshgrid(steps, steps, indexing="ij")
    points = np.empty((PHASES**2, rings, CORNERS, 2))
    points[:] = np.stack([x.ravel(), y.ravel()], -1)[:, None, None]
    cover = np.zeros((PHASES**2, size, size, rings + 1))
    ones, none = np.ones((rings, 1)), np.zeros(rings)
    channels = np.stack([np.arange(rings), np.arange(1, rings + 1)], -1)
    count = np.ones(rings, np.int64)
    shown = np.ones((PHASES**2, rings))
    paint_all(cover, points, shown, count, radii, none, ones, ones, channels, 0.0)
    shares = cover[..., :-1] - cover[..., 1:]
    sprite = np.empty((*cover.shape[:3], form.channels + 1))
    sprite[..., :-1] = FINE * (shares[..., None] * colours).sum(-2)
    sprite[..., -1] = OPAQUE * cover[..., 0]
    return np.round(sprite).astype(np.uint16).ravel(), size
