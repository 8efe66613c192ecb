"""Table without bodies, as a camera sees it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from marl_airhockey.sim.contracts.camera_model import (
    FELT,
    FLOOR,
    LINE,
    LINES,
    RING,
    CameraModel,
)
from marl_airhockey.sim.contracts.image_form import ImageForm
from marl_airhockey.sim.contracts.look import Colour
from marl_airhockey.sim.core.geometry import length, products
from marl_airhockey.sim.core.table import Table
from marl_airhockey.sim.sensing.images.templates import tones
from marl_airhockey.types import Array

SAMPLES = 6
"""Number of samples in a pixel along each axis."""
BEYOND: Colour = (0, 0, 0)
"""Colour beyond the edge of a frame."""
RIM, PAPER, INK = 1.4, (250, 250, 250), (57, 57, 57)
"""Factor from the size of a tag to that of its white rim, colour of the rim, and mean
colour of the tag."""


@lru_cache(maxsize=8)
def background(table: Table, model: CameraModel, form: ImageForm) -> Array:
    """Return the image (H, W, F * C) uint8 of a table without bodies."""
    window, count = model.window(table), form.size * SAMPLES
    axis = (np.arange(count) + 0.5) * (window.side / count) - 0.5
    x, y = np.meshgrid(axis + window.left, axis + window.top)
    image = _colours(table, model, model.places(np.stack([x, y], -1)), form)
    wide, high = model.size
    outside = (x < -0.5) | (y < -0.5) | (x > wide - 0.5) | (y > high - 0.5)
    image[outside] = tones(BEYOND, form)
    blocks = image.reshape(form.size, SAMPLES, form.size, SAMPLES, form.channels)
    small = np.round(blocks.mean((1, 3))).astype(np.uint8)
    return np.tile(small, form.frames)


def _colours(table: Table, model: CameraModel, at: Array, form: ImageForm) -> Array:
    """Return the values of the channels (..., C) at positions (..., 2), m."""
    image = np.empty((*at.shape[:-1], form.channels))
    image[:] = tones(FLOOR, form)
    on_table = (products(at, table.normals) + table.offsets).min(-1) >= 0.0
    distance, (inner, outer) = length(at), RING
    ring = (inner < distance) & (distance < outer)
    printed = (ring | (np.abs(at[..., 0]) < LINE)) & on_table
    for shown, colour in ((on_table, FELT), (printed, LINES)):
        image[shown] = tones(colour, form)
    for corners in map(np.asarray, model.tags):
        middle = corners.mean(0)
        for factor, colour in ((RIM, PAPER), (1.0, INK)):
            inside = _inside(at, middle + factor * (corners - middle))
            image[inside] = tones(colour, form)
    return image


def _inside(at: Array, corners: Array) -> Array:
    """Return True (...) for positions (..., 2) in a convex polygon (n, 2)."""
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
        (x, y), (dx, dy) = (at[..., k] - a[k] for k in range(2)), b - a
        sides.append(dx * y - dy * x > 0.0)
    every: Array = np.all(sides, 0) | ~np.any(sides, 0)
    return every
