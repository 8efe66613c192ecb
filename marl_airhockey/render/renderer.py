"""Pictures of the 2D table: anti-aliased, from above, home on the left.

One function draws a scene; the environment's `render`, the pictures in the docs and
the films all come from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from marl_airhockey.contracts.mark import Mark
from marl_airhockey.core.errors import unknown_name
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.state import State
from marl_airhockey.render.canvas import SMOOTH, Canvas, Colour
from marl_airhockey.types import Array

SEAT_COLOURS: tuple[Colour, ...] = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (230, 159, 0),
)
"""RGB; Okabe and Ito's palette, which colour-blind people can tell apart."""
RAIL, FIELD = (52, 62, 76), (250, 251, 253)
PRINT, FAINT, INK = (168, 196, 224), (214, 226, 238), (34, 40, 49)
PUCK, PUCK_RIM, BLOCK, BLOCK_RIM = (
    (46, 52, 64),
    (20, 24, 31),
    (222, 184, 112),
    (150, 112, 50),
)
GOAL = (200, 60, 90)


TOP = "top"
"""The view from above, which every backend has: drawn in 2D."""
WIDTH = 880
"""Pixels of a picture."""


@dataclass(frozen=True)
class Frame:
    """All that a picture shows of one world."""

    scene: Scene
    state: State
    """Without leading axes."""
    marks: Sequence[Mark] = ()
    trails: Sequence[Sequence[tuple[float, float]]] = ()
    """Recent places of each puck, oldest first, m."""
    title: str = ""
    note: str = ""
    """Score, at the right of the title bar."""
    clock: float = 0.0
    """Share of the episode that is over."""
    success: bool = False
    retired: Sequence[bool] = ()
    """Which seats are out of the game, if any are."""


def draw(frame: Frame, width: int = WIDTH) -> Array:
    """A picture (H, W, 3) uint8 RGB of a scene, ``width`` pixels wide."""
    canvas = Canvas(frame.scene.table, width, margin=0.075, bar=44)
    _table(canvas, frame)
    for mark in frame.marks:
        _mark(canvas, mark)
    for trail in frame.trails:
        _trail(canvas, trail, frame.scene.table.puck_radius)
    _bodies(canvas, frame.scene, frame.state)
    for mark in frame.marks:
        # A goal that a paddle can hide is drawn over it.
        if mark.kind == "circle" and mark.radius < frame.scene.table.paddle_radius:
            canvas.ring(mark.start, mark.radius, GOAL, 2)
    _bar(canvas, frame)
    return canvas.picture()


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
    canvas.ring((0, 0), 0.16, FAINT, 2)
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
        if goal_line.width is None or (any(frame.retired) and frame.retired[owner]):
            continue
        near, out = scene.opening(goal_line), -0.04 * table.normals[goal_line.side]
        gap = np.array([*near, *(near + out)[::-1]])
        canvas.polygon(gap, _pale(_seat_colour(scene, owner), 0.55))


def _mark(canvas: Canvas, mark: Mark) -> None:
    if mark.kind == "circle":
        canvas.disc(mark.start, mark.radius, _pale(GOAL, 0.82))
        canvas.ring(mark.start, mark.radius, GOAL, 2)
        return
    canvas.line(mark.start, mark.end, GOAL if mark.kind == "arrow" else PRINT, 2)
    if mark.kind == "arrow":
        tip, way = np.asarray(mark.end), np.subtract(mark.end, mark.start)
        size = float(np.hypot(*way))
        if size > 1e-6:
            back, side = way / size * 0.03, np.array([-way[1], way[0]]) / size * 0.014
            head = np.array([tip + back * 0.4, tip - back + side, tip - back - side])
            canvas.polygon(head, GOAL)


def _trail(canvas: Canvas, trail: Sequence[tuple[float, float]], radius: float) -> None:
    for i, (a, b) in enumerate(pairwise(trail)):
        age = (i + 1) / len(trail)
        if np.hypot(b[0] - a[0], b[1] - a[1]) < 0.4:
            wide = age * radius * canvas.scale / SMOOTH
            canvas.line(a, b, _pale(PUCK, 1 - 0.3 * age), wide)


def _bodies(canvas: Canvas, scene: Scene, state: State) -> None:
    bodies, place = scene.bodies, state.position
    radius, thin = bodies.radius, 1.5
    for obstacle in scene.obstacles:
        end = obstacle.end or obstacle.start
        wide = 2 * obstacle.radius * canvas.scale / SMOOTH
        canvas.line(obstacle.start, end, RAIL, wide)
        canvas.disc(obstacle.start, obstacle.radius, RAIL)
        canvas.disc(end, obstacle.radius, RAIL)
    for k in range(bodies.block.start, bodies.block.stop):
        if scene.block_shape == "disc":
            canvas.disc(place[k], radius[k], BLOCK)
            canvas.ring(place[k], radius[k], BLOCK_RIM, thin)
        else:
            c, s = np.cos(state.angle[k]), np.sin(state.angle[k])
            square = radius[k] * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
            corners = place[k] + square @ np.array([[c, s], [-s, c]])
            canvas.polygon(corners, BLOCK)
            canvas.polygon(corners, BLOCK_RIM, thin)
    for k in range(bodies.paddles):
        colour = _seat_colour(scene, k)
        canvas.disc(place[k], radius[k], colour)
        canvas.ring(place[k], radius[k] * 0.97, _dark(colour), thin)
        canvas.disc(place[k], radius[k] * 0.52, _pale(colour, 0.25))
        canvas.ring(place[k], radius[k] * 0.52, _dark(colour), 1)
    for k in range(bodies.puck.start, bodies.puck.stop):
        canvas.disc(place[k], radius[k], PUCK)
        canvas.ring(place[k], radius[k] * 0.96, PUCK_RIM, 1)
        canvas.ring(place[k], radius[k] * 0.55, _pale(PUCK, 0.35), thin)


def _bar(canvas: Canvas, frame: Frame) -> None:
    width = canvas.image.shape[1]
    canvas.image[: canvas.bar] = FIELD
    canvas.text(frame.title, 22, 0.55, INK, right=False)
    note = frame.note + ("   success" if frame.success else "")
    canvas.text(note, 22, 0.5, (0, 130, 95) if frame.success else INK, right=True)
    done = round(width * min(max(frame.clock, 0.0), 1.0))
    strip = slice(canvas.bar - 3 * SMOOTH, canvas.bar)
    canvas.image[strip] = FAINT
    canvas.image[strip, :done] = SEAT_COLOURS[0]


def _seat_colour(scene: Scene, seat: int) -> Colour:
    """Each seat has its own, unless teams play: mates share one, the second paler."""
    teams = [s.team for s in scene.seats]
    if len(set(teams)) in (1, len(teams)):
        return SEAT_COLOURS[seat % len(SEAT_COLOURS)]
    mates = [i for i, team in enumerate(teams) if team == teams[seat]]
    colour = SEAT_COLOURS[teams[seat] % len(SEAT_COLOURS)]
    return _pale(colour, 0.4 * mates.index(seat) / (len(mates) - 1))


def _pale(colour: Colour, share: float) -> Colour:
    r, g, b = (round(c + (255 - c) * share) for c in colour)
    return r, g, b


def _dark(colour: Colour) -> Colour:
    r, g, b = (round(c * 0.62) for c in colour)
    return r, g, b


@dataclass
class Renderer:
    """Shows one world of an environment, in a window if ``mode`` is human."""

    world: Any
    """A `world.World`."""
    mode: str
    title: str
    index: int = 0
    camera: str = TOP
    """`TOP`, or one of the backend's cameras."""
    _trails: list[list[tuple[float, float]]] = field(default_factory=list)
    _window: Any = None

    MODES = ("rgb_array", "human")
    TRAIL = 24

    def __post_init__(self) -> None:
        if self.mode not in self.MODES:
            raise ValueError(unknown_name("render_mode", self.mode, self.MODES))
        observables = (TOP, *self.world.backend.cameras)
        if self.camera not in observables:
            raise ValueError(unknown_name("camera", self.camera, observables))
        self.begin()

    def begin(self) -> None:
        """Forget the trails: an episode begins."""
        self._trails = [[] for _ in range(self.world.scene.pucks)]

    def follow(self) -> None:
        """After a reset or a step: lengthen the trails; in human mode show it."""
        for trail, puck in zip(
            self._trails, self.world.state.puck[self.index], strict=True
        ):
            trail.append((float(puck[0]), float(puck[1])))
            del trail[: -self.TRAIL]
        if self.mode == "human":
            self.show()

    def frame(self) -> Frame:
        """What there is to see now."""
        world, i = self.world, self.index
        state = world.state.map(lambda x: x[i])
        memory = {name: value[i] for name, value in world.memory.items()}
        episode, retired = world.episode, world.scenario.retired(memory)
        note = f"{world.scenario.caption(memory)}   {float(state.time):4.1f} s"
        if len(world.scene.seats) == 1:
            note += f"   return {episode.returns[i, 0]:+.2f}"
        return Frame(
            scene=world.scene,
            state=state,
            marks=world.scenario.marks(state, memory),
            trails=self._trails,
            title=self.title,
            note=note,
            clock=episode.cycles[i] / world.max_cycles,
            success=bool(episode.success[i].any()),
            retired=() if retired is None else retired.tolist(),
        )

    def picture(self, width: int = WIDTH) -> Array:
        """(H, W, 3) uint8 of what there is to see now."""
        frame = self.frame()
        if self.camera == TOP:
            return draw(frame, width)
        backend = self.world.backend
        taken: Array = backend.photograph(self.index, self.camera, frame.marks, width)
        return taken

    def show(self) -> Array | None:
        """The picture; in human mode it goes to the window and None comes back.

        Raises:
            RuntimeError: no episode has begun.
        """
        if not self.world.episode.number[self.index]:
            raise RuntimeError("render: call reset() first; there is nothing to see")
        picture = self.picture()
        if self.mode == "rgb_array":
            return picture
        from marl_airhockey.render.window import Window

        if self._window is None:
            rate = 1 / self.world.control_dt
            self._window = Window(picture.shape[1], picture.shape[0], rate)
        self._window.show(picture)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None
