"""Look of the table: the shapes and colours that images from above consist of.

Videos, windows and observations of images draw the same shapes. Functions of marks and
of bodies work for arrays with any leading axes (...), so they can be compiled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from marl_airhockey.sim.contracts.mark import Mark, Meaning
from marl_airhockey.sim.contracts.palette import LIGHT, SEATS, rgb
from marl_airhockey.sim.core.geometry import length, products
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.types import Array

Colour = tuple[int, int, int]
"""Colour in RGB, 0 to 255."""
SEAT_COLOURS: tuple[Colour, ...] = tuple(map(rgb, SEATS))
RAIL, FIELD, PRINT, FAINT, INK, PUCK, BLOCK, ROOM = (
    rgb(LIGHT[name])
    for name in ("rail", "field", "print", "faint", "ink", "puck", "block", "room")
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
PALE = 0.82
"""Share of white in the inner part of a circle."""
FRAME = 0.04
"""Width of the rail around the table, m."""


@dataclass(frozen=True)
class Shape:
    """Filled or outlined shape, table frame."""

    points: Array
    """Centre of a disc (..., 1, 2), ends of a line (..., 2, 2), or corners of a convex
    polygon (..., K, 2), m."""
    colour: Colour
    radius: float = 0.0
    """Radius of a disc, m."""
    line: float = 0.0
    """Width of the outline, or of the line, in pixels of an image of the usual width;
    0 for a filled shape."""
    fill: Colour | None = None
    """Colour inside the outline of a disc; None if it is transparent."""
    shown: Array | bool = True
    """(...) bool: the shape is visible."""


def pale(colour: Colour, share: float) -> Colour:
    """Return a colour that is mixed with a share of white, 0 to 1."""
    r, g, b = (round(c + (255 - c) * share) for c in colour)
    return r, g, b


def dark(colour: Colour) -> Colour:
    """Return a darker colour."""
    r, g, b = (round(c * 0.62) for c in colour)
    return r, g, b


def disc(
    centre: Array,
    radius: float,
    colour: Colour,
    line: float = 0.0,
    fill: Colour | None = None,
) -> Shape:
    """Return a disc with a centre (..., 2), or a circle if ``line`` is given."""
    return Shape(centre[..., None, :], colour, radius, line, fill)


def seat_colour(scene: Scene, seat: int, viewer: int = 0) -> Colour:
    """Return the colour of a seat or its team, paler for later teammates.

    Args:
        scene: Scene with the seats.
        seat: Index of the seat.
        viewer: Index of the seat that sees itself in the first colour.
    """
    teams, count = [s.team for s in scene.seats], len(SEAT_COLOURS)
    if len(set(teams)) in (1, len(teams)):
        return SEAT_COLOURS[(seat - viewer) % len(teams) % count]
    teammates = [i for i, team in enumerate(teams) if team == teams[seat]]
    if viewer in teammates:
        teammates = [viewer, *(i for i in teammates if i != viewer)]
    colour = SEAT_COLOURS[(teams[seat] - teams[viewer]) % len(set(teams)) % count]
    return pale(colour, 0.4 * teammates.index(seat) / (len(teammates) - 1))


def table_shapes(scene: Scene, viewer: int = 0) -> Iterator[Shape]:
    """Yield rails, field, lines, workspaces, goals and obstacles of a table.

    Args:
        scene: Scene on the table.
        viewer: Index of the seat that sees itself in the first colour.
    """
    table, sides = scene.table, [seat.side for seat in scene.seats]
    corners = np.asarray(table.vertices)
    grown = corners * (1 + FRAME / table.offsets.min())
    if len(corners) == 4:
        grown = np.sign(corners) * (np.abs(corners) + FRAME)
    yield Shape(grown, RAIL)
    yield Shape(corners, FIELD)
    half, middle = table.size[1] / 2, np.zeros(2)
    yield disc(middle, 0.14, PRINT, 2)
    if len(corners) == 4 and len(set(sides)) <= 2:
        yield Shape(np.array([(0, -half), (0, half)]), PRINT, line=2)
        for x in (-table.size[0] / 4, table.size[0] / 4):
            yield Shape(np.array([(x, -half), (x, half)]), FAINT, line=1)
    yield disc(middle, 0.012, PRINT)
    for i, seat in enumerate(scene.seats):
        workspace = products(np.asarray(seat.reach), table.rotation(seat.side).T)
        yield Shape(workspace, pale(seat_colour(scene, i, viewer), 0.86), line=1)
    for owner, gap in _gaps(scene):
        own = sides[owner] == sides[viewer]
        yield Shape(gap, seat_colour(scene, viewer if own else owner, viewer))
    for obstacle in table.obstacles:
        start, radius = np.asarray(obstacle.start), obstacle.radius
        end = np.asarray(obstacle.end or obstacle.start)
        if (along := end - start).any():
            across = radius * np.array([-along[1], along[0]]) / length(along)
            sides_of = start + across, end + across, end - across, start - across
            yield Shape(np.array(sides_of), RAIL)
        yield disc(start, radius, RAIL)
        yield disc(end, radius, RAIL)


def closed_goals(scene: Scene, eliminated: Array) -> Iterator[Shape]:
    """Yield the walls that replace the goals of eliminated seats (..., seats) bool."""
    for owner, gap in _gaps(scene):
        yield Shape(gap, RAIL, shown=eliminated[..., owner])


def _gaps(scene: Scene) -> Iterator[tuple[int, Array]]:
    """Yield the seat and the corners (4, 2) of each goal in the rail, m."""
    sides = [seat.side for seat in scene.seats]
    for goal_line in scene.goal_lines:
        if goal_line.width is not None:
            owner = sides.index(goal_line.side) if goal_line.side in sides else 0
            near = scene.opening(goal_line)
            out = near - FRAME * scene.table.normals[goal_line.side]
            yield owner, np.array([*near, *out[::-1]])


def mark_shapes(mark: Mark, scene: Scene) -> tuple[list[Shape], list[Shape]]:
    """Return the shapes of a mark that bodies cover, and those that cover bodies.

    The ring of a goal covers the bodies if a paddle could hide it.
    """
    below, over = list(_parts(mark)), list[Shape]()
    goal = mark.kind == "circle" and mark.means == "goal"
    if goal and mark.radius < scene.table.paddle_radius:
        inside = pale(GOAL, PALE)
        below = [disc(mark.start, mark.radius, inside)]
        over = [disc(mark.start, mark.radius, GOAL, 2)]
    seen = mark.shown
    return [replace(s, shown=seen) for s in below], [
        replace(s, shown=seen) for s in over
    ]


def _parts(mark: Mark) -> Iterator[Shape]:
    if mark.kind == "circle":
        colour, unit = CIRCLES[mark.means], 0.25 * mark.radius
        yield disc(mark.start, mark.radius, colour, 2, pale(colour, PALE))
        for lines in SIGNS.get(mark.means, []):
            ends = unit * np.array(lines).reshape(2, 2)
            sign = mark.start[..., None, :] + ends
            yield Shape(sign, pale(colour, 0.4), line=2)
        return
    start, end = mark.start, mark.end
    colour = GOAL if mark.kind == "arrow" else PRINT
    yield Shape(np.stack([start, end], -2), colour, line=2)
    if mark.kind == "arrow":
        offset = end - start
        ahead = offset / np.maximum(length(offset), 1e-6)[..., None]
        along = ahead * 0.03
        across = np.stack([-ahead[..., 1], ahead[..., 0]], -1) * 0.014
        base = end - along
        head = np.stack([end + along * 0.4, base + across, base - across], -2)
        yield Shape(head, GOAL)


def body_shapes(
    scene: Scene, body: int, centre: Array, angle: Array, viewer: int = 0
) -> list[Shape]:
    """Return the shapes of a paddle, a puck or a block; none for an obstacle.

    Those of a round body are concentric discs, the largest first.

    Args:
        scene: Scene on the table.
        body: Index of the body.
        centre: Position (..., 2), table frame, m.
        angle: Angle (...), rad, which only a square block shows.
        viewer: Index of the seat that sees itself in the first colour.
    """
    bodies = scene.bodies
    radius = bodies.radius[body]
    if body < bodies.paddles:
        colour = seat_colour(scene, body, viewer)
        return [
            disc(centre, radius * 0.97, dark(colour), 1.5, colour),
            disc(centre, radius * 0.52, dark(colour), 1, pale(colour, 0.25)),
        ]
    if body in range(bodies.puck.start, bodies.puck.stop):
        return [
            disc(centre, radius * 0.96, dark(PUCK), 1, PUCK),
            disc(centre, radius * 0.55, pale(PUCK, 0.35), 1.5, PUCK),
        ]
    if body not in range(bodies.block.start, bodies.block.stop):
        return []
    if scene.block_shape == "disc":
        return [disc(centre, radius, dark(BLOCK), 1.5, BLOCK)]
    c, s = cos(angle), sin(angle)
    along = radius * np.stack([c, s], -1)
    across = radius * np.stack([-s, c], -1)
    signs = (1, 1), (-1, 1), (-1, -1), (1, -1)
    corners = np.stack([centre + a * along + b * across for a, b in signs], -2)
    return [Shape(corners, BLOCK), Shape(corners, dark(BLOCK), line=1.5)]


def drawn_bodies(scene: Scene) -> list[int]:
    """Return the indices of all bodies but obstacles, the lowest first."""
    bodies = scene.bodies
    kinds = bodies.block, slice(0, bodies.paddles), bodies.puck
    return [k for kind in kinds for k in range(kind.start, kind.stop)]
