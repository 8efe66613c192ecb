"""Bodies of one world during the event loop, and the objects that they can touch.

Bodies are rows of one array, because numba counts references to each array of a world.
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
"""Columns of a body.

- Position (m), velocity (m/s), spin (rad/s), angle (rad) and radius (m).
- Inverse mass (1/kg), and inverse mass of the edge of a spinning disc: its squared
  radius divided by its inertia (1/kg).
- In the next move (m/s): mean velocity with contacts, mean velocity without contacts,
  and velocity at the end.
- For paddles, the velocity at the end of the step (m/s).
- Highest speed (m/s) and acceleration (m/s2) in the rest of the step.
- Two displacements that bound the path, and the distance of the fall in addition (m).
- For paddles, 1 if it began within its workspace, and 1 if it could leave its
  workspace, so that the edges limit it.
"""

ASKS, PRESCRIBED, PUCK, BLOCK, AWAY, PINNED = range(6)
"""Roles of bodies: a paddle that stops at an immovable puck; a position-driven paddle;
a puck; a block; a body that touches nothing; a pinned puck."""

NX, NY, RESTITUTION, FRICTION, KICK = range(5)
CONTACT = 5
"""Columns of a contact: unit normal from the first body to the second, restitution,
friction, and contact noise of the puck. The noise is a speed along the wall (m/s) or,
at a paddle, a speed of the puck's edge divided by the speed of the puck."""

TINY = 1e-9
"""Closing speed that counts as 0, m/s."""

SLOP = 2e-4
"""Largest overlap that is not corrected, m."""


@inner(error_model="numpy", forceinline=True)
def distance_between(
    m: Array, i: int, j: int, walls: Array, obstacles: Array
) -> tuple[float, float, float]:
    """Return gap and normal from body i, or fixed object -1 - i, to body j, m."""
    if i < 0:
        gap, nx, ny = distance_to_fixed(m[j, X], m[j, Y], -1 - i, walls, obstacles)
        return gap - m[j, RADIUS], nx, ny
    dx, dy = m[j, X] - m[i, X], m[j, Y] - m[i, Y]
    gap, nx, ny = distance_to_point(dx, dy)
    return gap - m[i, RADIUS] - m[j, RADIUS], nx, ny


@inner(error_model="numpy", forceinline=True)
def closing(m: Array, at: int, i: int, j: int, nx: float, ny: float) -> float:
    """Return the normal speed of j relative to i, m/s, from velocity column ``at``."""
    speed = nx * m[j, at] + ny * m[j, at + 1]
    if i >= 0:
        speed -= nx * m[i, at] + ny * m[i, at + 1]
    return float(speed)


@inner(error_model="numpy", forceinline=True)
def fixed_range(
    m: Array, role: Array, j: int, held: int, edges: int, end: int
) -> tuple[int, int]:
    """Return the range (first, last + 1) of the fixed objects that body j can touch.

    A paddle with `HELD` can touch the edges of its workspace.

    Args:
        m: Bodies (N, BODY).
        role: Roles of the bodies (N,).
        j: Index of the body.
        held: Number of edges of all workspaces, which are the first walls.
        edges: Number of edges of one workspace.
        end: Number of fixed objects.
    """
    if role[j] > PRESCRIBED:
        return held, end
    is_held = role[j] == ASKS and m[j, HELD] > 0.0
    return (j * edges, (j + 1) * edges) if is_held else (0, 0)


@inner(error_model="numpy", forceinline=True)
def partner(place: int, j: int, low: int) -> int:
    """Return an object that body j can touch, by its position in the list of them.

    The bodies before j come first, then the fixed objects from ``low`` on.
    """
    return place if place < j else -1 - (low + place - j)


@inner(error_model="numpy", forceinline=True)
def slop(role: Array, i: int, j: int) -> float:
    """Return the largest overlap of j with i that is not corrected, m; 0 at an edge."""
    return 0.0 if i < 0 and role[j] <= PRESCRIBED else SLOP


@inner(error_model="numpy", forceinline=True)
def shares(
    m: Array, role: Array, i: int, j: int, stops: bool
) -> tuple[float, float, float, float]:
    """Return inverse masses of two bodies and of their edges; 0 for an immovable one.

    A paddle yields to another paddle, to the edge of its workspace and, if it
    ``stops``, to a puck.
    """
    if role[j] <= PRESCRIBED:
        mine = 1.0 if i >= 0 and role[i] == ASKS else 0.0
        return mine, 1.0 if role[j] == ASKS else 0.0, 0.0, 0.0
    if stops and i >= 0 and role[i] == ASKS:
        return 1.0, 0.0, 0.0, 0.0
    if i < 0:
        return 0.0, m[j, MASS], 0.0, m[j, EDGE]
    return m[i, MASS], m[j, MASS], m[i, EDGE], m[j, EDGE]
