"""Pixel observations: small grey images of the table in a seat's ego frame."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

SHIFT = 6
"""Number of fractional bits of OpenCV's coordinates."""


def small_picture(
    scene: Scene,
    position: Array,
    goal: Array | None,
    rotation: Array,
    seat: int,
    size: int,
) -> Array:
    """Render the observation of a seat: (size, size) uint8 grey, ego frame.

    Args:
        scene: Bodies on the table.
        position: Sensed positions (N, 2), table frame, m.
        goal: Desired position (2,), table frame, m, or None.
        rotation: Rotation (2, 2) from the table frame to the seat's ego frame.
        seat: Index of the seat. Its own paddle is brighter than the others.
        size: Width and height, pixels.
    """
    # Imported here, because the rest of the package needs only numpy and numba.
    import cv2

    image = np.zeros((size, size), np.uint8)
    corners = products(np.asarray(scene.table.vertices), rotation)
    extent = float(np.abs(corners).max())
    scale = (size / 2 - 1) / extent

    def pixel(point: Array) -> tuple[int, int]:
        x, y = products(point, rotation) * scale
        return round((size / 2 + x) * 2**SHIFT), round((size / 2 - y) * 2**SHIFT)

    outline = np.array([pixel(np.asarray(c)) for c in scene.table.vertices], np.int32)
    cv2.fillPoly(image, [outline], 50, cv2.LINE_AA, SHIFT)
    if goal is not None:
        wide = round(0.05 * scale * 2**SHIFT)
        cv2.circle(image, pixel(goal), wide, 110, 1, cv2.LINE_AA, SHIFT)
    for k, (kind, radius) in enumerate(
        zip(scene.bodies.kind, scene.bodies.radius, strict=True)
    ):
        grey = (140, 255, 90, 70)[kind] + (60 if k == seat else 0)
        wide = round(radius * scale * 2**SHIFT)
        cv2.circle(image, pixel(position[k]), wide, grey, -1, cv2.LINE_AA, SHIFT)
    return image


def pictures_of(
    scene: Scene, frames: Array, goals: Array | None, seats: Array, size: int
) -> Array:
    """Render observations of seats of W worlds: (W, seats, size, size, F) uint8.

    Args:
        scene: Bodies on the table.
        frames: Sensed positions (W, F, N, 2), table frame, newest last, m.
        goals: Desired positions (W, 2), table frame, m, or None.
        seats: Indices (n,) of the seats.
        size: Width and height, pixels.
    """
    out = np.empty((len(frames), len(seats), size, size, frames.shape[1]), np.uint8)
    for b, world in enumerate(frames):
        goal = None if goals is None else goals[b]
        for row, seat in enumerate(seats):
            rotation = scene.table.rotation(scene.seats[seat].side)
            for k, frame in enumerate(world):
                picture = small_picture(scene, frame, goal, rotation, int(seat), size)
                out[b, row, :, :, k] = picture
    return out
