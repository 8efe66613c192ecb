"""Frames of a camera that a seat observes, with the state of its own paddle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from marl_airhockey.sim.contracts.camera_model import (
    ARM,
    PADDLE_TOP,
    PUCK_TOP,
    CameraModel,
    project,
)
from marl_airhockey.sim.contracts.image_form import (
    OWN,
    OWN_SIZE,
    PIXELS,
    ImageForm,
    check_forms,
    image_form,
    shows_images,
)
from marl_airhockey.sim.contracts.look import Shape, mark_shapes
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.geometry import products
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.fused import Source
from marl_airhockey.sim.jit.threads import over_rows
from marl_airhockey.sim.sensing.images.camera_background import background
from marl_airhockey.sim.sensing.images.images import LEAST, Moving, TableImages
from marl_airhockey.sim.sensing.images.photograph import Silhouettes, photograph
from marl_airhockey.sim.sensing.images.raster import paint_all
from marl_airhockey.sim.sensing.images.templates import LUMA, simple, tones
from marl_airhockey.types import ALL, Array, Rows


class CameraImages(TableImages):
    """Frames of a fixed camera above B tables, each with one arm.

    An observation is a dictionary: ``pixels`` (H, W, F * C) uint8, and ``agent_pos``
    (4,) float32, the position, m, and velocity, m/s, of the own paddle that the robot
    reports, ego frame. The outlines of marks are drawn over the frames.

    Args:
        scenario: Scenario of the worlds.
        form: Settings of the images.
        num_worlds: Number of worlds, B.
        model: Camera above the tables.

    Raises:
        ValueError: The scene has more than one seat, or obstacles, or the images of
            all worlds need more memory than this machine has.
    """

    def __init__(
        self,
        scenario: Scenario,
        form: ImageForm,
        num_worlds: int,
        model: CameraModel,
    ) -> None:
        seats = len(scenario.scene.seats)
        if seats != 1:
            raise ValueError(
                f"observe: a camera shows one arm, but {scenario.name!r} has {seats} "
                'seats; use observe="pixels"'
            )
        if scenario.scene.obstacles:
            raise ValueError(
                "observe: a camera does not show obstacles, which no real table has; "
                'use observe="pixels"'
            )
        super().__init__(scenario, form, num_worlds)
        self.model, scene = model, scenario.scene
        window = model.window(scene.table)
        scale = form.size / window.side
        self._window = np.array([window.left, window.top, scale])
        self._look = _silhouettes(scene, form, model)

    def _scale(self) -> float:
        middle = np.array([project(self.model.numbers, x, 0.0, 0.0) for x in (0, 0.01)])
        step = middle[1] - middle[0]
        return float(100.0 * np.sqrt((step * step).sum()) * self._window[2])

    def _shapes_of(
        self, frames: Array, state: State, memory: Mapping[str, Array]
    ) -> tuple[list[Shape], list[list[Shape]], list[Shape]]:
        marks = self.scenario.all_marks(state, dict(memory))
        parts = [
            p
            for m in marks
            for part in mark_shapes(m, self.scenario.scene)
            for p in part
        ]
        top = [replace(self._visible(p), fill=None) for p in parts if p.line]
        return [], [[] for _ in range(self.form.frames)], simple(top)

    def collect(
        self, frames: Array, state: Source, memory: Source, worlds: Rows = ALL
    ) -> Moving:
        moving = super().collect(frames, state, memory, worlds)
        scene, now = self.scenario.scene, State(**state)
        axes = scene.table.rotation(scene.seats[0].side)
        motion = now.paddle[worlds, 0], now.paddle_velocity[worlds, 0]
        paddle = np.concatenate([products(part, axes) for part in motion], -1)
        return moving._replace(own=paddle.astype(np.float32))

    def draw(self, moving: Moving, seats: Array) -> dict[str, Array]:
        scene, form, model = self.scenario.scene, self.form, self.model
        worlds, kinds = len(moving.frames), self._kinds
        assert kinds is not None
        out = self._pool.take(worlds)[0][:, 0]
        marks = kinds.outer, kinds.inside, kinds.colours, kinds.fills, self._channels

        def work(rows: slice) -> None:
            frames = moving.frames[rows]
            if frames.dtype == np.uint8:
                out[rows] = self._toned(frames)
            else:
                out[rows] = background(scene.table, model, form)
                photos = np.ascontiguousarray(frames)
                photograph(out[rows], model.numbers, self._window, photos, self._look)
            x, y = moving.points[rows, ..., 0], moving.points[rows, ..., 1]
            pixels = np.stack(project(model.numbers, x, y, 0.0), -1)
            at = (pixels + 0.5 - self._window[:2]) * self._window[2]
            paint_all(out[rows], at, moving.shown[rows], kinds.count, *marks, 0.5)

        over_rows(work, worlds, LEAST)
        return {PIXELS: out[:, None], OWN: moving.own[:, None]}

    def _toned(self, frames: Array) -> Array:
        """Return images (W, H, W, F * C) of real frames (W, F, size, size, 3)."""
        if self.form.channels == 1:
            frames = np.round((frames * LUMA).sum(-1, keepdims=True)).astype(np.uint8)
        return np.concatenate([*np.moveaxis(frames, 1, 0)], -1)

    def blank(self, rows: int) -> dict[str, Array]:
        own = np.zeros((rows, OWN_SIZE), np.float32)
        return {PIXELS: np.zeros((rows, *self.form.shape), np.uint8), OWN: own}


def _silhouettes(scene: Scene, form: ImageForm, model: CameraModel) -> Silhouettes:
    """Return sizes and colours of the bodies of a scene and of its arm."""
    bodies, numbers = scene.bodies, np.arange(len(scene.bodies))
    kinds = bodies.block, bodies.puck, bodies.paddle
    order = [k for kind in kinds for k in range(kind.start, kind.stop)]
    in_block = (numbers >= bodies.block.start) & (numbers < bodies.block.stop)
    colours = [model.paddle] * bodies.paddles + [model.puck] * bodies.pucks
    colours += [model.block] * (len(bodies) - len(colours))
    return Silhouettes(
        np.array(order, np.int64),
        np.array(bodies.radius),
        in_block & (scene.block_shape == "square"),
        np.where(numbers < bodies.paddles, PADDLE_TOP, PUCK_TOP),
        np.array([tones(colour, form) for colour in colours]),
        bodies.paddles,
        np.array(model.base),
        tones(ARM, form),
        model.exposure,
    )


def images_of(
    scenario: Scenario,
    forms: Iterable[str],
    num_worlds: int,
    cameras: Mapping[str, CameraModel],
) -> dict[str, TableImages]:
    """Return the images of the observation types that have images.

    Args:
        scenario: Scenario of the worlds.
        forms: Observation types.
        num_worlds: Number of worlds, B.
        cameras: Cameras of the types that show one.

    Raises:
        ValueError: A type is unknown, or a setting of images is not allowed.
    """
    check_forms(forms)
    found: dict[str, TableImages] = {}
    for form in filter(shows_images, forms):
        if scenario.goals == "dict":
            raise ValueError(
                f"observe: {form}: images show the goal; omit goals='dict'"
            )
        given = scenario, image_form(form), num_worlds
        camera = cameras.get(form)
        found[form] = CameraImages(*given, camera) if camera else TableImages(*given)
    return found
