"""Camera above the lab's table, which the arm hides in part."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from marl_airhockey.hardware.lab.camera import (
    CIRCLE,
    SHADOW,
    LabCamera,
)
from marl_airhockey.hardware.lab.drawing import draw_polygon, fill, paste_tag, shade
from marl_airhockey.hardware.vision.lens import CameraView, Lens
from marl_airhockey.hardware.vision.mark import LENGTH, WIDTH
from marl_airhockey.sim.contracts.camera_model import (
    ARM,
    BLOCK,
    FELT,
    LINE,
    LINES,
    PADDLE,
    PADDLE_TOP,
    PUCK,
    PUCK_TOP,
    RING,
    lab_camera,
)
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import Table
from marl_airhockey.sim.sensing.images.photograph import link
from marl_airhockey.types import Array

MARK = (25, 25, 25)
"""Colour of the mark on a puck."""
TAGS_BESIDE = 0.075
"""Distance of the tags' centres from the table's edge, m."""


def lab_view(table: Table) -> CameraView:
    """Return the true view of the lab's camera above its table."""
    model = lab_camera(table)
    lens = Lens(model.matrix, model.distortion, model.size)
    vector, _ = cv2.Rodrigues(np.array(model.rotation))
    x, y, z = (float(v) for v in vector[:, 0])
    return CameraView(lens, (x, y, z), model.translation)


def tag_places(table: Table) -> dict[int, Array]:
    """Return the centres (2,) of the tags around a table, m, by their numbers."""
    x, y = table.size / 2
    along = np.linspace(-0.86 * x, 0.86 * x, 4)
    sides = [(float(a), s * (float(y) + TAGS_BESIDE)) for s in (1, -1) for a in along]
    return {k: np.array(centre) for k, centre in enumerate(sides)}


@dataclass
class Seen:
    """Moving bodies in the middle of an exposure, table frame."""

    puck: Array | None
    """Position (2,) of the puck, m; None if it is not on the table."""
    puck_velocity: Array
    """Velocity (2,) of the puck, m/s."""
    paddle: Array
    """Position (2,) of the paddle, m."""
    paddle_velocity: Array
    """Velocity (2,) of the paddle, m/s."""
    puck_angle: float = 0.0
    """Orientation of the puck, rad."""
    puck_spin: float = 0.0
    """Angular velocity of the puck, rad/s."""
    block: tuple[Array, Array] | None = None
    """Position, m, and velocity, m/s, (2,) of the block; None without one."""


class TableCamera(LabCamera[Seen]):
    """Camera above a simulated table.

    Args:
        table: Table in the view.
        view: View of the camera.
        base: Position (2,) of the arm's base, table frame, m.
        exposure: Exposure time, s.
        seed: Seed of the image noise.
        marked: True for a puck with a mark, see `vision.mark`.
    """

    def __init__(
        self,
        table: Table,
        view: CameraView,
        base: Array,
        exposure: float = 1 / 120,
        seed: int = 0,
        marked: bool = False,
    ) -> None:
        self._marked = marked
        self._table, self._base = table, np.asarray(base)
        self.left: Array | None = None
        """Position (2,) of a second puck at rest, m; None without one."""
        super().__init__(view, exposure, seed)

    def _draw_still(self, scene: Array, view: CameraView) -> None:
        fill(scene, view, np.asarray(self._table.vertices), 0.0, FELT)
        inner, outer = RING
        fill(scene, view, outer * CIRCLE, 0.0, LINES)
        fill(scene, view, inner * CIRCLE, 0.0, FELT)
        y = float(self._table.size[1]) / 2
        middle = np.array([(-LINE, -y), (LINE, -y), (LINE, y), (-LINE, y)])
        fill(scene, view, middle, 0.0, LINES)
        for number, centre in tag_places(self._table).items():
            paste_tag(scene, view, number, centre)

    def _draw(
        self, part: Array, seen: Seen, later: float, corner: tuple[int, int]
    ) -> None:
        view, radius = self.view, self._table.puck_radius
        paddle = seen.paddle + later * seen.paddle_velocity
        moved = None if seen.puck is None else seen.puck + later * seen.puck_velocity
        discs = [(puck, radius, PUCK) for puck in (self.left, moved)]
        if seen.block is not None:
            place, velocity = seen.block
            discs.insert(0, (place + later * velocity, Scene.block_radius, BLOCK))
        for at, wide, colour in discs:
            if at is not None:
                shade(part, view, at + SHADOW + wide * CIRCLE, corner)
                fill(part, view, at + wide * CIRCLE, PUCK_TOP, colour, corner)
        if moved is not None and self._marked:
            bar = moved + _bar(radius, seen.puck_angle + later * seen.puck_spin)
            fill(part, view, bar, PUCK_TOP, MARK, corner)
        size = self._table.paddle_radius
        shade(part, view, paddle + 4 * SHADOW + size * CIRCLE, corner)
        fill(part, view, paddle + size * CIRCLE, PADDLE_TOP, PADDLE, corner)
        draw_polygon(part, view.project(_link(paddle, self._base)) - corner, ARM)

    def _outlines(self, seen: Seen) -> list[Array]:
        table = self._table
        found = [
            self.view.project(_link(seen.paddle, self._base)),
            self._disc(seen.paddle, table.paddle_radius),
        ]
        block = None if seen.block is None else seen.block[0]
        for puck in (self.left, seen.puck, block):
            if puck is not None:
                found.insert(0, self._disc(puck, table.paddle_radius))
        return found

    def _speed(self, seen: Seen) -> float:
        moving = [seen.puck_velocity, seen.paddle_velocity]
        moving += [] if seen.block is None else [seen.block[1]]
        return max(float(np.linalg.norm(velocity)) for velocity in moving)


def _bar(radius: float, angle: float) -> Array:
    """Return the corners (4, 2) of the mark on a puck, from its centre, m."""
    x, y = radius * LENGTH / 2, radius * WIDTH / 2
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([(x, y), (-x, y), (-x, -y), (x, -y)])
    return np.asarray(corners @ np.array([[c, s], [-s, c]]))


def _link(paddle: Array, base: Array) -> Array:
    """Return the corners (4, 3) of the arm's last link, table frame, m.

    Args:
        paddle: Position (2,) of the paddle, m.
        base: Position (2,) of the arm's base, m.
    """
    corners = np.zeros((4, 3))
    link(paddle[0], paddle[1], base, corners)
    return corners
