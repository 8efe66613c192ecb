"""Images that seats observe: what moves is collected, and a compiled loop draws it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.sim.contracts.image_form import (
    ImageForm,
)
from marl_airhockey.sim.contracts.look import (
    Shape,
    body_shapes,
    closed_goals,
    mark_shapes,
)
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.jit.buffers import BufferPool
from marl_airhockey.sim.jit.fused import Fused, Sink, Source
from marl_airhockey.sim.jit.threads import over_rows
from marl_airhockey.sim.sensing.images.drawing import render
from marl_airhockey.sim.sensing.images.raster import CORNERS
from marl_airhockey.sim.sensing.images.templates import (
    USUAL_WIDTH,
    Outlines,
    Templates,
    outlines,
    padded,
    scale_of,
    simple,
    templates,
)
from marl_airhockey.types import ALL, Array, Rows

LEAST = 64
"""Smallest number of worlds whose images are worth a thread."""
THINNEST = 1.0
"""Smallest width of a line of a mark, pixels, so that marks are visible in small
images."""
COPIES = 3
"""Number of batches of images in memory: before and after a step, and those of a
learner."""


Images = Array | dict[str, Array]
"""Images of seats, or a dictionary of them and other elements of observations."""


class Moving(NamedTuple):
    """Moving parts of the images of W worlds."""

    frames: Array
    """Sensed positions, table frame, m, and angles (W, F, N, 3), the newest last, or
    frames of a camera, see `photos.Photos`."""
    points: Array
    """Points (W, n, CORNERS, 2) of marks and other shapes, table frame, m."""
    shown: Array
    """Visibility (W, n) of these shapes, 1 or 0."""
    own: Array
    """Other elements of the observations (W, k), float32."""


class TableImages:
    """Images of B worlds, in which seats observe the table in their ego frames.

    Bodies, marks and regions look as in a video, without title, trails and the stripe
    of a puck. Every seat sees itself in the first colour.

    Args:
        scenario: Scenario of the worlds.
        form: Settings of the images.
        num_worlds: Number of worlds, B.

    Raises:
        ValueError: The images of all worlds need more memory than this machine has.
    """

    def __init__(self, scenario: Scenario, form: ImageForm, num_worlds: int) -> None:
        self.scenario, self.form = scenario, form
        seats = len(scenario.scene.seats)
        _check_memory(COPIES * num_worlds * seats * int(np.prod(form.shape)), form)
        self._shapes = Fused(self._moving, scenario.name)
        self._kinds: Outlines | None = None
        self._moves = False
        self._channels, self._below = np.zeros((0, 2), np.int64), 0
        self._pool = BufferPool([((seats, *form.shape), np.uint8)])
        self._templates: Templates | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_templates": None}

    def prepare(self, frames: Array, state: Source, memory: Source) -> None:
        """Compile what moves, once; the arguments are those of `collect`."""
        if self._kinds is not None:
            return
        frames = self._newest(frames)
        shapes, squares, top = self._shapes_of(frames, State(**state), dict(memory))
        depth = self.form.channels
        every = 0, self.form.frames * depth
        found = [*shapes, *(s for frame in squares for s in frame), *top]
        self._kinds = outlines(found, self._scale(), self.form)
        rows = [every] * len(shapes)
        for f, frame in enumerate(squares):
            rows += [(f * depth, (f + 1) * depth)] * len(frame)
        rows += [every] * len(top)
        self._channels = np.array(rows, np.int64).reshape(-1, 2)
        self._below = len(found) - len(top)
        self._moves = bool(found)
        if found:
            self._shapes.prepare(state, memory, {"frames": frames})

    def read(
        self,
        frames: Array,
        state: Source,
        memory: Source,
        seats: Array,
        worlds: Rows = ALL,
    ) -> Images:
        """Return the observations of some seats: `collect` and `draw`."""
        return self.draw(self.collect(frames, state, memory, worlds), seats)

    def collect(
        self, frames: Array, state: Source, memory: Source, worlds: Rows = ALL
    ) -> Moving:
        """Return the moving parts of the images of W worlds.

        Args:
            frames: Sensed positions, table frame, m, and angles (B, F, N, 3), the
                newest last.
            state: Sensed state of all worlds, table frame, by name.
            memory: Memory of the scenario in all worlds.
            worlds: Worlds that are shown.
        """
        self.prepare(frames, state, memory)
        newest = self._newest(frames)
        shown = newest[worlds]
        none = np.zeros((len(shown), 0))
        if not self._moves:
            points = np.zeros((len(shown), 0, CORNERS, 2))
            return Moving(shown, points, none, none)
        sources = state, memory, {"frames": newest}
        every = isinstance(worlds, slice)
        shapes = self._shapes
        (found,) = (
            shapes(*sources) if every else shapes.at(np.asarray(worlds), *sources)
        )
        return Moving(shown, found["points"], found["shown"], none)

    def draw(self, moving: Moving, seats: Array) -> Images:
        """Return the images of some seats (W, S, H, W, channels), uint8, a new array.

        Args:
            moving: Result of `collect`, or some of its rows.
            seats: Indices (S,) of the seats.
        """
        fixed, kinds = self._fixed(), self._kinds
        assert kinds is not None
        worlds, every = len(moving.frames), len(seats) == len(fixed.views)
        shape = worlds, len(seats), *self.form.shape
        out = self._pool.take(worlds)[0] if every else np.empty(shape, np.uint8)
        backgrounds, views = fixed.backgrounds[seats], fixed.views[seats]

        def work(rows: slice) -> None:
            # NumPy copies much faster than a compiled loop.
            np.copyto(out[rows], backgrounds)
            render(
                *(out[rows], views, moving.frames[rows]),
                *(fixed.order, fixed.kinds[seats], fixed.sprites, fixed.places),
                *(moving.points[rows], moving.shown[rows]),
                *(kinds.count, kinds.outer, kinds.inside, kinds.colours, kinds.fills),
                *(self._channels, self._below),
            )

        over_rows(work, worlds, LEAST)
        return out

    def blank(self, rows: int) -> Images:
        """Return observations of one seat that are all zeros (rows, ...)."""
        return np.zeros((rows, *self.form.shape), np.uint8)

    def _scale(self) -> float:
        """Return the scale of the images, pixels/m."""
        return scale_of(self.scenario.scene, self.form)

    def _newest(self, frames: Array) -> Array:
        """Return the last frames of a history that may be longer."""
        return np.ascontiguousarray(frames[:, -self.form.frames :])

    def _fixed(self) -> Templates:
        """Return the templates, which copies of this object lack at first."""
        if self._templates is None:
            self._templates = templates(self.scenario.scene, self.form)
        return self._templates

    def _shapes_of(
        self, frames: Array, state: State, memory: Mapping[str, Array]
    ) -> tuple[list[Shape], list[list[Shape]], list[Shape]]:
        """Return the shapes below bodies, the square blocks by frame, and the top."""
        game = self.scenario
        scene = game.scene
        marks = [mark_shapes(m, scene) for m in game.all_marks(state, dict(memory))]
        below = [self._visible(shape) for lower, _ in marks for shape in lower]
        top = [self._visible(shape) for _, upper in marks for shape in upper]
        eliminated = game.eliminated(dict(memory))
        if eliminated is not None:
            below += closed_goals(scene, eliminated)
        squares: list[list[Shape]] = []
        if scene.block_shape == "square":
            blocks = range(scene.bodies.block.start, scene.bodies.block.stop)
            for f in range(self.form.frames):
                at = frames[..., f, :, :]
                squares.append(
                    [
                        shape
                        for k in blocks
                        for shape in body_shapes(
                            scene, k, at[..., k, :2], at[..., k, 2]
                        )
                    ]
                )
        return simple(below), [simple(frame) for frame in squares], simple(top)

    def _visible(self, shape: Shape) -> Shape:
        """Return the shape of a mark with lines that are wide enough."""
        thinnest = THINNEST * USUAL_WIDTH / self.form.size
        return replace(shape, line=max(shape.line, thinnest)) if shape.line else shape

    def _moving(self, state: Source, memory: Source, past: Source) -> tuple[Sink]:
        """Return the points (..., n, CORNERS, 2) and the visibility (..., n)."""
        now, known = State(**state), dict(memory)
        below, squares, top = self._shapes_of(past["frames"], now, known)
        zero = np.zeros_like(now.time)
        found = [*below, *(s for frame in squares for s in frame), *top]
        corner = zero[..., None, None]
        points = [padded(corner + shape.points) for shape in found]
        shown = np.stack([zero + 1.0 * s.shown for s in found], -1)
        return ({"points": np.stack(points, -3), "shown": shown},)


def _check_memory(needed: int, form: ImageForm) -> None:
    """Raise ValueError if a number of bytes is more than the memory of this machine."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > total:
        raise ValueError(
            f"pixels: images {form.shape} of all worlds need {needed / 2**30:.0f} GiB, "
            f"and this machine has {total / 2**30:.0f} GiB; use fewer worlds, smaller "
            "images or fewer frames"
        )
