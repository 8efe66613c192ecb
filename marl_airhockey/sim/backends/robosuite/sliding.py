"""Sliding: physics of pucks and blocks that MuJoCo's contacts do not model.

MuJoCo's contacts push only along their normals, over several steps. Direction and size
of the normal impulse follow from the change of a puck's velocity in a step. Friction
then acts along the tangent, as in `core.laws.impulse`. Over a contact it ends the slip,
or its impulse is the friction coefficient times the normal impulse. The restitution at
a wall follows from the speed at which a puck approaches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.laws import cap, impulse, wall_restitution
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array

MASS, GRIP, PULL_X, PULL_Y, DRAG, DAMPING = range(6)
"""Columns of a body's coefficients: mass (kg), deceleration by Coulomb friction (m/s2),
acceleration by the slope along x and y (m/s2), quadratic (1/m) and linear drag
(1/s)."""
AT_ONE, SLOPE, WALL, PADDLE, PUCK = range(5)
"""Contact parameters of a table: restitution of walls at 1 m/s, its loss per ln(m/s);
friction at walls, paddles and pucks."""
NEAR = 2e-3
"""Gap up to which bodies may be in contact, m."""
SAME = 0.98
"""Cosine of the largest angle between two directions that count as equal."""


class Sliding(NamedTuple):
    """Arrays of the pucks and blocks of one table in one MuJoCo model."""

    place: Array
    """Indices of x in qpos (movers,), before y and the angle."""
    dofs: Array
    """Indices of x in qvel (movers,), before y and the angle."""
    radius: Array
    """Radii of a paddle, then of pucks and blocks (1 + movers,), m."""
    pucks: int
    """Number of pucks, which are the first movers."""
    coefficients: Array
    """Coefficients of the bodies (movers, 6)."""
    laws: Array
    """Contact parameters of the table (5,)."""
    sides: Array
    """Sides of the table (sides, 6), see `walls.sides`."""
    rails: Array
    """Indices of the geoms of rails (G,)."""
    rail_side: Array
    """Side of each rail (G,)."""
    damping: Array
    """Damping in solref of contacts with restitution 0, 0.01 .. 1 (101,)."""
    solref: Array
    """Array solref of MuJoCo (geoms, 2), changed for rails."""
    expected: Array
    """Velocities of the pucks after a step without contacts (pucks, 2), m/s; nan if
    they are unknown. Persists."""
    approach: Array
    """Approach speeds of the pucks to the sides (pucks, sides), m/s; persists."""


@compiled()
def apply_laws(
    sliding: Sliding,
    paddles: Array,
    places: Array,
    speeds: Array,
    forces: Array,
    dt: float,
) -> None:
    """Apply drag, friction and restitution to pucks and blocks before a physics step.

    Args:
        sliding: Arrays of the table.
        paddles: Columns x, y, vx, vy of the paddles (seats, 4), table frame.
        places: Array qpos of MuJoCo (nq,).
        speeds: Array qvel of MuJoCo (nv,), changed.
        forces: Array qfrc_applied of MuJoCo (nv,), filled for pucks and blocks.
        dt: Length of a physics step, s.
    """
    coefficients = sliding.coefficients
    for i in range(sliding.pucks):
        _rub(sliding, i, paddles, places, speeds)
    for i in range(len(sliding.dofs)):
        k, row = sliding.dofs[i], coefficients[i]
        vx, vy = speeds[k], speeds[k + 1]
        if i < sliding.pucks:
            share = cap(vx, vy)
            vx, vy = share * vx, share * vy
            speeds[k], speeds[k + 1] = vx, vy
            push = -row[DRAG] * np.hypot(vx, vy)
            forces[k], forces[k + 1] = row[MASS] * push * vx, row[MASS] * push * vy
            # MuJoCo integrates linear drag implicitly.
            left = 1.0 / (1.0 + dt * row[DAMPING])
            sliding.expected[i, 0] = left * (vx + dt * (row[PULL_X] + push * vx))
            sliding.expected[i, 1] = left * (vy + dt * (row[PULL_Y] + push * vy))
            continue
        # Velocity without friction, which removes at most all of it.
        vx, vy = vx + row[PULL_X] * dt, vy + row[PULL_Y] * dt
        size = np.hypot(vx, vy)
        if size > 0.0:
            push = -row[MASS] * min(row[GRIP], size / dt) / size
            forces[k], forces[k + 1] = push * vx, push * vy
    _set_restitutions(sliding, places, speeds)


@inner()
def _rub(
    sliding: Sliding, i: int, paddles: Array, places: Array, speeds: Array
) -> None:
    """Apply the friction of the body that pushed puck i in the last step."""
    k, at = sliding.dofs[i], sliding.place[i]
    nx, ny = speeds[k] - sliding.expected[i, 0], speeds[k + 1] - sliding.expected[i, 1]
    push = np.hypot(nx, ny)
    if not push > 1e-9:
        return
    nx, ny, radius = nx / push, ny / push, sliding.radius[1 + i]
    x, y = places[at], places[at + 1]
    slip = nx * speeds[k + 1] - ny * speeds[k] - radius * speeds[k + 2]
    friction, mass, other = sliding.laws[WALL], 0.0, -1
    for s in range(len(paddles)):
        dx, dy = x - paddles[s, 0], y - paddles[s, 1]
        if _pushes(dx, dy, nx, ny, sliding.radius[0] + radius):
            friction = sliding.laws[PADDLE]
            slip -= nx * paddles[s, 3] - ny * paddles[s, 2]
    for j in range(len(sliding.dofs)):
        dx, dy = x - places[sliding.place[j]], y - places[sliding.place[j] + 1]
        touch = sliding.radius[1 + j] + radius
        if j == i or not _pushes(dx, dy, nx, ny, touch):
            continue
        if j < i and j < sliding.pucks:
            # The call for the other puck has changed both.
            return
        friction, other = sliding.laws[PUCK], j
        d = sliding.dofs[j]
        slip -= nx * speeds[d + 1] - ny * speeds[d]
        mass = sliding.coefficients[i, MASS] / sliding.coefficients[j, MASS]
        if j < sliding.pucks:
            slip -= sliding.radius[1 + j] * speeds[d + 2]
    spins = 2.0 if 0 <= other < sliding.pucks else 0.0
    # Masses are in units of the puck's mass; the push is the normal impulse.
    _, rub = impulse(push, slip, 0.0, friction, 1.0, 3.0 + mass + spins)
    speeds[k] -= rub * ny
    speeds[k + 1] += rub * nx
    speeds[k + 2] -= 2.0 * rub / radius
    if other >= 0:
        d = sliding.dofs[other]
        speeds[d] += mass * rub * ny
        speeds[d + 1] -= mass * rub * nx
        speeds[d + 2] -= spins * rub / sliding.radius[1 + other]


@inner()
def _pushes(dx: float, dy: float, nx: float, ny: float, touch: float) -> bool:
    """Return True if a body may push along a normal; (dx, dy) points from it, m."""
    distance = np.hypot(dx, dy)
    return bool(0.0 < distance < touch + NEAR and nx * dx + ny * dy > SAME * distance)


@inner()
def _set_restitutions(sliding: Sliding, places: Array, speeds: Array) -> None:
    """Set the restitution of each side's rails for the puck that is nearest to it."""
    if sliding.laws[SLOPE] == 0.0:
        return
    for s in range(len(sliding.sides)):
        nx, ny, offset = sliding.sides[s, 0], sliding.sides[s, 1], sliding.sides[s, 2]
        nearest, speed = np.inf, 0.0
        for i in range(sliding.pucks):
            k, at = sliding.dofs[i], sliding.place[i]
            gap = nx * places[at] + ny * places[at + 1] + offset - sliding.radius[1 + i]
            if gap > 0.0:
                coming = -nx * speeds[k] - ny * speeds[k + 1]
                sliding.approach[i, s] = max(coming, 0.0)
            if gap < nearest:
                nearest, speed = gap, sliding.approach[i, s]
        share = wall_restitution(speed, sliding.laws[AT_ONE], sliding.laws[SLOPE])
        at = min(int(100.0 * share), 99)
        part = 100.0 * share - at
        value = (1.0 - part) * sliding.damping[at] + part * sliding.damping[at + 1]
        for g in range(len(sliding.rails)):
            if sliding.rail_side[g] == s:
                sliding.solref[sliding.rails[g], 1] = value
