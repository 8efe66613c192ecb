"""Anti-aliased images of the 2D table from above, with the home end on the left.

`draw` renders a `Frame`. Environments, videos and the images of the documentation use
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import get_args

import numpy as np

from marl_airhockey.sim.contracts.mark import Mark, Meaning
from marl_airhockey.sim.contracts.palette import LIGHT, SEATS, rgb
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.render.canvas import SMOOTH, Canvas, Colour
from marl_airhockey.types import Array

SEAT_COLOURS: tuple[Colour, ...] = tuple(map(rgb, SEATS))
RAIL, FIELD, PRINT, FAINT, INK, PUCK, BLOCK = (
    rgb(LIGHT[name])
    for name in ("rail", "field", "print", "faint", "ink", "puck", "block")
)
CIRCLES: dict[Meaning, Colour] = {
    meaning: rgb(LIGHT[meaning]) for meaning in get_args(Meaning)
}
"""Colours of circles by meaning."""
GOAL = CIRCLES["goal"]
SIGNS: dict[Meaning, list[tuple[float, float, float, float]]] = {
    "reward": [(-1, 0, 1, 0), (0, -1, 0, 1)],
    "cost": [(-1, 0, 1, 0)],
    "drag": [(-1, -0.5, 1, -0.5), (-1, 0.5, 1, 0.5)],
}
"""Lines of the sign at the centre of a region, in quarters of its radius."""
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
    _table(canvas, frame)
    for mark in frame.marks:
        _mark(canvas, mark)
    for trail, puck in zip(frame.trails, frame.state.puck, strict=False):
        _trail(canvas, trail, puck, frame.scene.table.puck_radius)
    _bodies(canvas, frame.scene, frame.state)
    for mark in frame.marks:
        # Draw a goal that a paddle can hide again, over the paddle.
        goal = mark.kind == "circle" and mark.means == "goal"
        if goal and mark.radius < frame.scene.table.paddle_radius:
            canvas.ring(mark.start, mark.radius, GOAL, 2)
    if bar:
        _bar(canvas, frame)
    return canvas.finish()


def _table(canvas: Canvas, frame: Frame) -> None:
    scene, table = frame.scene, frame.scene.table
    corners, sides = np.asarray(table.vertices), [seat.side for seat in scene.seats]
    grown = corners * (1 + 0.04 / table.offsets.min())
    box = np.abs(corners) + 0.04
    if len(corners) == 4:
        grown = np.sign(corners) * box
    canvas.polygon(grown, RAIL)
    canvas.polygon(corners, FIELD)
    half = table.size[1] / 2
    canvas.ring((0, 0), 0.14, PRINT, 2)
    if len(corners) == 4 and len(set(sides)) <= 2:
        canvas.line((0, -half), (0, half), PRINT, 2)
        for x in (-table.size[0] / 4, table.size[0] / 4):
            canvas.line((x, -half), (x, half), FAINT, 1)
    canvas.disc((0, 0), 0.012, PRINT)
    for i, seat in enumerate(scene.seats):
        reach = np.asarray(seat.reach) @ table.rotation(seat.side)
        canvas.polygon(reach, _pale(_seat_colour(scene, i), 0.86), 1)
    for goal_line in scene.goal_lines:
        owner = sides.index(goal_line.side) if goal_line.side in sides else 0
        if goal_line.width is None or (
            any(frame.eliminated) and frame.eliminated[owner]
        ):
            continue
        near, out = scene.opening(goal_line), -0.04 * table.normals[goal_line.side]
        gap = np.array([*near, *(near + out)[::-1]])
        canvas.polygon(gap, _seat_colour(scene, owner))


def _mark(canvas: Canvas, mark: Mark) -> None:
    if mark.kind == "circle":
        colour, (x, y), unit = CIRCLES[mark.means], mark.start, 0.25 * mark.radius
        canvas.disc(mark.start, mark.radius, _pale(colour, 0.82))
        canvas.ring(mark.start, mark.radius, colour, 2)
        for ax, ay, bx, by in SIGNS.get(mark.means, []):
            ends = (x + unit * ax, y + unit * ay), (x + unit * bx, y + unit * by)
            canvas.line(*ends, _pale(colour, 0.4), 2)
        return
    canvas.line(mark.start, mark.end, GOAL if mark.kind == "arrow" else PRINT, 2)
    if mark.kind == "arrow":
        tip, offset = np.asarray(mark.end), np.subtract(mark.end, mark.start)
        length = float(np.hypot(*offset))
        if length > 1e-6:
            along = offset / length * 0.03
            across = np.array([-offset[1], offset[0]]) / length * 0.014
            base = tip - along
            head = np.array([tip + along * 0.4, base + across, base - across])
            canvas.polygon(head, GOAL)


def _trail(
    canvas: Canvas,
    trail: Sequence[tuple[float, float]],
    puck: Array,
    radius: float,
) -> None:
    """Draw a trail that ends at the puck (2,) and is narrow and pale at its start."""
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
        colour = _pale(PUCK, 1 - 0.3 * i / len(points))
        canvas.polygon(np.array([a + first, b + last, b - last, a - first]), colour)
        canvas.disc(a, widths[0], colour)
        canvas.disc(b, widths[1], colour)


def _bodies(canvas: Canvas, scene: Scene, state: State) -> None:
    bodies, position = scene.bodies, state.position
    radius, thin = bodies.radius, 1.5
    for obstacle in scene.obstacles:
        end = obstacle.end or obstacle.start
        wide = 2 * obstacle.radius * canvas.scale / SMOOTH
        canvas.line(obstacle.start, end, RAIL, wide)
        canvas.disc(obstacle.start, obstacle.radius, RAIL)
        canvas.disc(end, obstacle.radius, RAIL)
    for k in range(bodies.block.start, bodies.block.stop):
        if scene.block_shape == "disc":
            canvas.disc(position[k], radius[k], BLOCK)
            canvas.ring(position[k], radius[k], _dark(BLOCK), thin)
        else:
            c, s = np.cos(state.angle[k]), np.sin(state.angle[k])
            square = radius[k] * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
            corners = position[k] + square @ np.array([[c, s], [-s, c]])
            canvas.polygon(corners, BLOCK)
            canvas.polygon(corners, _dark(BLOCK), thin)
    for k in range(bodies.paddles):
        colour = _seat_colour(scene, k)
        canvas.disc(position[k], radius[k], colour)
        canvas.ring(position[k], radius[k] * 0.97, _dark(colour), thin)
        canvas.disc(position[k], radius[k] * 0.52, _pale(colour, 0.25))
        canvas.ring(position[k], radius[k] * 0.52, _dark(colour), 1)
    for k in range(bodies.puck.start, bodies.puck.stop):
        canvas.disc(position[k], radius[k], PUCK)
        canvas.ring(position[k], radius[k] * 0.96, _dark(PUCK), 1)
        canvas.ring(position[k], radius[k] * 0.55, _pale(PUCK, 0.35), thin)
        # A stripe shows the spin.
        angle = float(state.angle[k])
        arm = 0.55 * radius[k] * np.array([np.cos(angle), np.sin(angle)])
        canvas.line(position[k] - arm, position[k] + arm, _pale(PUCK, 0.35), thin)


def _bar(canvas: Canvas, frame: Frame) -> None:
    width = canvas.image.shape[1]
    canvas.image[: canvas.bar] = FIELD
    note = frame.note + ("   success" if frame.success else "")
    colours = INK, _dark(GOAL) if frame.success else INK
    canvas.titles(frame.title, note, colours)
    done = round(width * min(max(frame.clock, 0.0), 1.0))
    strip = slice(canvas.bar - 3 * SMOOTH, canvas.bar)
    canvas.image[strip] = FAINT
    canvas.image[strip, :done] = SEAT_COLOURS[0]


def _seat_colour(scene: Scene, seat: int) -> Colour:
    """Return the colour of a seat or its team, paler for later teammates."""
    teams = [s.team for s in scene.seats]
    if len(set(teams)) in (1, len(teams)):
        return SEAT_COLOURS[seat % len(SEAT_COLOURS)]
    teammates = [i for i, team in enumerate(teams) if team == teams[seat]]
    colour = SEAT_COLOURS[teams[seat] % len(SEAT_COLOURS)]
    return _pale(colour, 0.4 * teammates.index(seat) / (len(teammates) - 1))


def _pale(colour: Colour, share: float) -> Colour:
    r, g, b = (round(c + (255 - c) * share) for c in colour)
    return r, g, b


def _dark(colour: Colour) -> Colour:
    r, g, b = (round(c * 0.62) for c in colour)
    return r, g, b
