"""Camera over a table: lens, pose and times, in simulation and on a real table."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, floor
from typing import Any

import numpy as np

from marl_airhockey.sim.contracts.look import Colour
from marl_airhockey.sim.core.table import Table
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.types import Array

FELT, FLOOR, LINES = (224, 226, 222), (70, 75, 70), (180, 190, 205)
PUCK, PADDLE, BLOCK, ARM = (205, 40, 42), (60, 165, 70), (30, 90, 190), (90, 92, 96)
"""Colours of the virtual lab."""
PUCK_TOP, PADDLE_TOP = 0.003, 0.06
"""Heights of the tops of a puck or a block, and of a paddle, m."""
RING, LINE = (0.115, 0.12), 0.003
"""Inner and outer radius of the ring at the centre, and half the width of the centre
line, m."""
AROUND = 0.05
"""Share of the table's size that is visible around it."""
BEHIND = 0.22
"""Distance of an arm's base from the edge of the table, m."""
ITERATIONS = 20
"""Number of steps of the iteration that removes the distortion of a lens."""


@dataclass(frozen=True)
class FrameWindow:
    """Square part of a camera's frame, which may extend beyond the frame."""

    left: int
    top: int
    side: int
    """Left and upper end, and width and height, px."""


@dataclass(frozen=True)
class CameraModel:
    """Fixed camera that sees a table, an arm and its paddle.

    Pixel (0, 0) of a frame is the upper left one, and (0, 0) is its centre, as in
    OpenCV.
    """

    matrix: tuple[tuple[float, float, float], ...]
    """Camera matrix (3, 3), px."""
    distortion: tuple[float, ...]
    """Coefficients k1, k2, p1, p2, k3 of Brown's model, as in OpenCV."""
    size: tuple[int, int]
    """Width and height of the frames, px."""
    rotation: tuple[tuple[float, float, float], ...]
    """Rotation (3, 3) from the table frame to the camera frame."""
    translation: tuple[float, float, float]
    """Centre of the table, camera frame, m."""
    base: tuple[float, float]
    """Position of the arm's base, table frame, m."""
    latency: float = 0.028
    """Time from the middle of an exposure until its frame has arrived, s."""
    period: float = 1 / 30
    """Time between two frames, s."""
    exposure: float = 1 / 120
    """Exposure time, s."""
    dropped: float = 0.0
    """Share of the frames that do not arrive."""
    puck: Colour = PUCK
    paddle: Colour = PADDLE
    block: Colour = BLOCK
    tags: tuple[tuple[tuple[float, float], ...], ...] = field(default=())
    """Corners of the printed tags, table frame, m."""

    @cached_property
    def numbers(self) -> Array:
        """Rotation, translation, fx, fy, cx, cy and distortion as an array (21,)."""
        fx, fy = self.matrix[0][0], self.matrix[1][1]
        cx, cy = self.matrix[0][2], self.matrix[1][2]
        distortion = (*self.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
        pose = np.ravel(self.rotation), self.translation
        return np.concatenate([*pose, [fx, fy, cx, cy], distortion])

    @property
    def centre(self) -> Array:
        """Position (3,) of the camera, table frame, m."""
        return -self._to_table(np.asarray(self.translation))

    def _to_table(self, vectors: Array) -> Array:
        """Rotate vectors (..., 3) from the camera frame to the table frame."""
        x, y, z = (vectors[..., k, None] for k in range(3))
        rows = np.asarray(self.rotation)
        return np.asarray(x * rows[0] + y * rows[1] + z * rows[2])

    def places(self, pixels: Array) -> Array:
        """Return the positions (..., 2), m, on the table at pixels (..., 2), px."""
        n = self.numbers
        (fx, fy, cx, cy), (k1, k2, p1, p2, k3) = n[12:16], n[16:]
        u, v = (pixels[..., 0] - cx) / fx, (pixels[..., 1] - cy) / fy
        x, y = u, v
        for _ in range(ITERATIONS):
            r = x * x + y * y
            factor = 1.0 + r * (k1 + r * (k2 + r * k3))
            dx = 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x)
            dy = p1 * (r + 2.0 * y * y) + 2.0 * p2 * x * y
            x, y = (u - dx) / factor, (v - dy) / factor
        ray = self._to_table(np.stack([x, y, np.ones_like(x)], -1))
        centre = self.centre
        far: Array = centre[:2] - centre[2] / ray[..., 2:] * ray[..., :2]
        return far

    def window(self, table: Table) -> FrameWindow:
        """Return the smallest square of the frame with the table and its surround."""
        corners = (1.0 + AROUND) * np.asarray(table.vertices)
        pixels = np.array([project(self.numbers, x, y, 0.0) for x, y in corners])
        low, high = pixels.min(0), pixels.max(0)
        side = ceil((high - low).max())
        left, top = (floor(m) for m in (low + high) / 2 - side / 2 + 0.5)
        return FrameWindow(left, top, side)


@inner(error_model="numpy")
def project(numbers: Array, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
    """Return the pixels of points (...), table frame, m.

    Args:
        numbers: Numbers of the camera, see `CameraModel.numbers`.
        x: Position along the table, m.
        y: Position across the table, m.
        z: Height above the table, m.
    """
    n = numbers
    deep = n[6] * x + n[7] * y + n[8] * z + n[11]
    u = (n[0] * x + n[1] * y + n[2] * z + n[9]) / deep
    v = (n[3] * x + n[4] * y + n[5] * z + n[10]) / deep
    r = u * u + v * v
    factor = 1.0 + r * (n[16] + r * (n[17] + r * n[20]))
    across = u * factor + 2.0 * n[18] * u * v + n[19] * (r + 2.0 * u * u)
    down = v * factor + n[18] * (r + 2.0 * v * v) + 2.0 * n[19] * u * v
    return n[12] * across + n[14], n[13] * down + n[15]


def lab_camera(table: Table) -> CameraModel:
    """Return the camera of the virtual lab above a table."""
    focal = 602.0 * 1.9304 / max(table.size[0], 1.2)
    rotation = _rotation(np.pi + 0.06, 0.03, 0.02)
    x, y, z = (-(rotation * (-0.03, 0.05, 2.15)).sum(-1)).tolist()
    rows = tuple(tuple(row) for row in rotation.tolist())
    return CameraModel(
        ((focal, 0.0, 322.0), (0.0, focal, 243.0), (0.0, 0.0, 1.0)),
        (-0.10, 0.04, 0.0, 0.0, 0.0),
        (640, 480),
        rows,
        (x, y, z),
        (-float(table.offsets[0]) - BEHIND, 0.0),
    )


def _rotation(x: float, y: float, z: float) -> Array:
    """Return the matrix of a rotation vector, rad (Rodrigues, 1840)."""
    angle = float(np.sqrt(x * x + y * y + z * z))
    a, b, c = x / angle, y / angle, z / angle
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    along = np.outer([a, b, c], [a, b, c])
    c, s = cos(angle), sin(angle)
    return np.asarray(c * np.eye(3) + s * cross + (1.0 - c) * along)
