"""Bodies of one world while it moves from contact to contact, and what they may touch.

They are rows of one array, as numba counts references to every array of a world.
"""

from __future__ import annotations

from marl_airhockey.sim.backends.numba.geometry import (
    distance_to_fixed,
    distance_to_point,
)
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.types import Array

X, Y, VX, VY, SPIN, ANGLE, RADIUS, MASS, EDGE = range(9)
DX, DY, CX, CY, EX, EY, GX, GY, REACH, BEND = range(9, 19)
EARLY_X, EARLY_Y, LATE_X, LATE_Y, FALL, INSIDE, HELD = range(19, 26)
BODY = 26
"""Columns of a body: position, velocity, spin, angle and radius; inverse mass, and
that of a spinning disc's edge (radius squared over its inertia); in the coming move
its mean velocity with contacts and without, and its velocity at the end; for paddles
the velocity at the end of the step; highest speed (m/s) and acceleration (m/s2) in what
is left of the step; two points that its way lies between, from where it is, and how far
it falls besides (m); for paddles 1 if it began within its reach, and 1 if it could get
out, so that the edges hold it."""

ASKS, PRESCRIBED, PUCK, BLOCK, AWAY, PINNED = range(6)
"""Roles of bodies: a paddle that stops where a puck cannot give way, one that does not;
pucks; blocks; what touches nothing; and a puck that has no room left."""

NX, NY, RESTITUTION, FRICTION, KICK = range(5)
CONTACT = 5
"""Columns of a contact: unit normal from the first body to the second, restitution,
friction, and what scatter adds to the puck: speed along a wall (m/s), or at a paddle
speed of the edge per speed of the puck."""

TINY = 1e-9
"""Closing speed that is none (m/s)."""

SLOP = 2e-4
"""Overlap that is left alone (m)."""


@inner(error_model="numpy", forceinline=True)
def distance_between(
    m: Array, i: int, j: int, walls: Array, obstacles: Array
) -> tuple[float, float, float]:
    """Return the gap of body j to body i, or to fixed object -1 - i, and its normal."""
    if i < 0:
        gap, nx, ny = distance_to_fixed(m[j, X], m[j, Y], -1 - i, walls, obstacles)
        return gap - m[j, RADIUS], nx, ny
    dx, dy = m[j, X] - m[i, X], m[j, Y] - m[i, Y]
    gap, nx, ny = distance_to_point(dx, dy)
    return gap - m[i, RADIUS] - m[j, RADIUS], nx, ny


@inner(error_model="numpy", forceinline=True)
def closing(m: Array, at: int, i: int, j: int, nx: float, ny: float) -> float:
    """Return the normal speed of j from i, m/s; ``at`` is the column of velocities."""
    speed = nx * m[j, at] + ny * m[j, at + 1]
    if i >= 0:
        speed -= nx * m[i, at] + ny * m[i, at + 1]
    return float(speed)


@inner(error_model="numpy", forceinline=True)
def fixed_range(
    m: Array, role: Array, j: int, held: int, edges: int, end: int
) -> tuple[int, int]:
    """Return the first fixed object that body j can touch, and the one after the last.

    The edges of its reach are in the way of a paddle that `HELD` marks.

    Args:
        m: bodies.
        role: roles.
        j: body.
        held: number of walls that hold paddles, ``edges`` each, which come first.
        edges: of each paddle's reach.
        end: number of fixed objects.
    """
    if role[j] > PRESCRIBED:
        return held, end
    is_held = role[j] == ASKS and m[j, HELD] > 0.0
    return (j * edges, (j + 1) * edges) if is_held else (0, 0)


@inner(error_model="numpy", forceinline=True)
def partner(place: int, j: int, low: int) -> int:
    """Return what comes at a place in the list of all that body j can touch.

    The bodies before it come first, then its fixed objects, from ``low`` on.
    """
    return place if place < j else -1 - (low + place - j)


@inner(error_model="numpy", forceinline=True)
def slop(role: Array, i: int, j: int) -> float:
    """Return the overlap of body j with i that is left alone, m: none with an edge."""
    return 0.0 if i < 0 and role[j] <= PRESCRIBED else SLOP


@inner(error_model="numpy", forceinline=True)
def shares(
    m: Array, role: Array, i: int, j: int, stops: bool
) -> tuple[float, float, float, float]:
    """Return who gives way: inverse masses of two bodies, and of their edges.

    A paddle gives way to another, to the edge of its reach and, if it ``stops``, to a
    puck.
    """
    if role[j] <= PRESCRIBED:
        mine = 1.0 if i >= 0 and role[i] == ASKS else 0.0
        return mine, 1.0 if role[j] == ASKS else 0.0, 0.0, 0.0
    if stops and i >= 0 and role[i] == ASKS:
        return 1.0, 0.0, 0.0, 0.0
    if i < 0:
        return 0.0, m[j, MASS], 0.0, m[j, EDGE]
    return m[i, MASS], m[j, MASS], m[i, EDGE], m[j, EDGE]
