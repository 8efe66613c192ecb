"""Camera above a person's hand that moves a paddle on a field."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from marl_airhockey.hardware.lab.camera import (
    CIRCLE,
    SHADOW,
    LabCamera,
)
from marl_airhockey.hardware.lab.drawing import draw_polygon, fill, paste_tag, shade
from marl_airhockey.hardware.vision.lens import CameraView, Lens
from marl_airhockey.sim.contracts.camera_model import FELT, PADDLE, PADDLE_TOP
from marl_airhockey.types import Array

FIELD = (0.5, 0.6)
"""Length and width of the field, m."""
RADIUS = 0.047625
"""Radius of the paddle, m."""
SKIN = (205, 150, 120)
"""Colour in RGB."""
RIM = 0.07
"""Distance of the tags' centres from the field's edge, m."""
HAND_HEIGHTS = np.array([0.10, 0.10, 0.14, 0.14])
"""Heights of the corners of hand and forearm above the field, m."""


def hand_view() -> CameraView:
    """Return the true view of the camera above the field."""
    matrix = ((640.0, 0.0, 318.0), (0.0, 640.0, 238.0), (0.0, 0.0, 1.0))
    lens = Lens(matrix, (-0.08, 0.03, 0.0, 0.0, 0.0), (640, 480))
    rotation, _ = cv2.Rodrigues(np.array([np.pi - 0.05, 0.02, -0.03]))
    vector, _ = cv2.Rodrigues(rotation)
    x, y, z = (float(v) for v in vector[:, 0])
    tx, ty, tz = (float(v) for v in -rotation @ np.array([0.02, -0.03, 1.25]))
    return CameraView(lens, (x, y, z), (tx, ty, tz))


def hand_tag_places() -> dict[int, Array]:
    """Return the centres (2,) of the tags around the field, m, by their numbers.

    There are no tags at the near edge, over which the arm reaches.
    """
    x, y = FIELD[0] / 2, FIELD[1] / 2 + RIM
    sides = [(-0.8 * x, y), (0.8 * x, y), (-0.8 * x, -y), (0.8 * x, -y)]
    far = [(x + RIM, 0.6 * y), (x + RIM, -0.6 * y)]
    return {k: np.array(place) for k, place in enumerate([*sides, *far])}


class SeenHand(NamedTuple):
    """Hand in the middle of an exposure, field frame."""

    place: Array | None
    """Position (2,) of the paddle, m; None without a hand."""
    velocity: Array
    """Velocity (2,) of the paddle, m/s."""


class HandCamera(LabCamera[SeenHand]):
    """Camera above a field on which a hand moves a paddle."""

    def _draw_still(self, scene: Array, view: CameraView) -> None:
        half = np.array(FIELD) / 2
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        fill(scene, view, corners * half, 0.0, FELT)
        for number, centre in hand_tag_places().items():
            paste_tag(scene, view, number, centre)

    def _draw(
        self, part: Array, seen: SeenHand, later: float, corner: tuple[int, int]
    ) -> None:
        if seen.place is None:
            return
        position = seen.place + later * seen.velocity
        shade(part, self.view, position + 4 * SHADOW + RADIUS * CIRCLE, corner)
        fill(part, self.view, position + RADIUS * CIRCLE, PADDLE_TOP, PADDLE, corner)
        pixels = self.view.project(np.column_stack([_forearm(position), HAND_HEIGHTS]))
        draw_polygon(part, pixels - corner, SKIN)

    def _outlines(self, seen: SeenHand) -> list[Array]:
        if seen.place is None:
            return []
        points = np.column_stack([_forearm(seen.place), HAND_HEIGHTS])
        return [self.view.project(points), self._disc(seen.place, RADIUS)]

    def _speed(self, seen: SeenHand) -> float:
        return float(np.linalg.norm(seen.velocity))


def _forearm(position: Array) -> Array:
    """Return the corners (4, 2), m, of hand and forearm for a paddle position (2,)."""
    offsets = [(-0.005, 0.02), (-0.005, -0.02), (-0.45, -0.025), (-0.45, 0.065)]
    return np.asarray(position + np.array(offsets))
