"""Anti-aliased images of the 2D table from above, with the home end on the left.

`draw` renders a `Frame`. Environments, videos and the images of the documentation use
it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from marl_airhockey.sim.contracts.look import (
    FAINT,
    FIELD,
    GOAL,
    INK,
    PUCK,
    SEAT_COLOURS,
    Shape,
    body_shapes,
    closed_goals,
    dark,
    disc,
    drawn_bodies,
    mark_shapes,
    pale,
    table_shapes,
)
from marl_airhockey.sim.contracts.mark import Mark
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.render.canvas import SMOOTH, Canvas
from marl_airhockey.types import Array

TRAIL, SERVED = 0.6, 0.4
"""Half the width of a trail at the puck, in radii of the puck, and the distance, m,
above which a puck was re-served between two points."""
WIDTH = 880
"""Default width of an image, pixels."""
BAR = 44
"""Height of the title bar, pixels."""


@dataclass(frozen=True)
class Frame:
    """Contents of an image of one world."""

    scene: Scene
    state: State
    """State without leading axes."""
    marks: Sequence[Mark] = ()
    trails: Sequence[Sequence[tuple[float, float]]] = ()
    """Recent positions of each puck, oldest first, table frame, m."""
    title: str = ""
    note: str = ""
    """Text at the right of the title bar, for example the score."""
    clock: float = 0.0
    """Share of the time limit that has passed, 0 to 1."""
    success: bool = False
    eliminated: Sequence[bool] = ()
    """True for eliminated seats (seats,); empty if no seat can be eliminated."""


def draw(frame: Frame, width: int = WIDTH, bar: int = BAR) -> Array:
    """Return the image (H, W, 3) uint8 RGB of a frame.

    Args:
        frame: Contents of the image.
        width: Width of the image, pixels.
        bar: Height of the title bar, pixels; 0 for none.
    """
    canvas = Canvas(frame.scene.table, width, margin=0.075, bar=bar)
    for shape in shapes_of(frame):
        canvas.paint(shape)
    if bar:
        _bar(canvas, frame)
    return canvas.finish()


def shapes_of(frame: Frame) -> Iterator[Shape]:
    """Yield the shapes of an image, the lowest first."""
    scene, state = frame.scene, frame.state
    yield from table_shapes(scene)
    if len(frame.eliminated):
        walls = closed_goals(scene, np.asarray(frame.eliminated))
        yield from (wall for wall in walls if wall.shown)
    marks = [mark_shapes(mark, scene) for mark in frame.marks]
    for below, _ in marks:
        yield from below
    for trail, puck in zip(frame.trails, state.puck, strict=False):
        yield from _trail(trail, puck, scene.table.puck_radius)
    for k in drawn_bodies(scene):
        centre, angle = state.position[k], state.angle[k]
        yield from body_shapes(scene, k, centre, angle)
        if k in range(scene.bodies.puck.start, scene.bodies.puck.stop):
            yield _stripe(centre, float(angle), scene.bodies.radius[k])
    for _, over in marks:
        yield from over


def _stripe(centre: Array, angle: float, radius: float) -> Shape:
    """Return the stripe of a puck, which shows the spin."""
    arm = 0.55 * radius * np.array([np.cos(angle), np.sin(angle)])
    return Shape(np.array([centre - arm, centre + arm]), pale(PUCK, 0.35), line=1.5)


def _trail(
    trail: Sequence[tuple[float, float]], puck: Array, radius: float
) -> Iterator[Shape]:
    """Yield a trail that ends at the puck (2,) and is narrow and pale at its start."""
    # The newest point can be later than the drawn puck.
    points = np.array([*trail[:-1], puck])
    for i, (a, b) in enumerate(pairwise(points), 1):
        along = b - a
        length = float(np.hypot(*along))
        if not 0 < length < SERVED:
            continue
        widths = TRAIL * radius * np.array([i - 1, i]) / len(points)
        across = np.array([-along[1], along[0]]) / length
        first, last = widths[0] * across, widths[1] * across
        colour = pale(PUCK, 1 - 0.3 * i / len(points))
        yield Shape(np.array([a + first, b + last, b - last, a - first]), colour)
        yield disc(a, widths[0], colour)
        yield disc(b, widths[1], colour)


def _bar(canvas: Canvas, frame: Frame) -> None:
    width = canvas.image.shape[1]
    canvas.image[: canvas.bar] = FIELD
    note = frame.note + ("   success" if frame.success else "")
    colours = INK, dark(GOAL) if frame.success else INK
    canvas.titles(frame.title, note, colours)
    done = round(width * min(max(frame.clock, 0.0), 1.0))
    strip = slice(canvas.bar - 3 * SMOOTH, canvas.bar)
    canvas.image[strip] = FAINT
    canvas.image[strip, :done] = SEAT_COLOURS[0]
