"""Time of impact: motion of the bodies of one world up to their first contact."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.arrays import (
    BLOCK_GRIP,
    DAMPING,
    DRAG,
    NORMAL_X,
    NORMAL_Y,
    OFFSET,
    PULL_X,
    PULL_Y,
)
from marl_airhockey.sim.backends.numba.bodies import (
    ANGLE,
    AWAY,
    CX,
    CY,
    DX,
    DY,
    EX,
    EY,
    FRICTION,
    GX,
    GY,
    MASS,
    NX,
    NY,
    PINNED,
    PUCK,
    RADIUS,
    RESTITUTION,
    SPIN,
    TINY,
    VX,
    VY,
    X,
    Y,
    closing,
    distance_between,
)
from marl_airhockey.sim.backends.numba.broad_phase import BOW, list_near_drift
from marl_airhockey.sim.backends.numba.geometry import (
    ahead_of_mouth,
    distance_to_fixed,
    in_contact,
)
from marl_airhockey.sim.backends.numba.impacts import solve
from marl_airhockey.sim.core.laws import fly, slide
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.sim.jit.elementary import exp, log
from marl_airhockey.types import Array

REFINEMENTS = 5
"""Number of searches for the first touch, each with another chord."""
WIDE = 1.7
"""Factor of the moves of discs that slide in a jam; they separate by 0.9 mm."""
LATER = 1.1
"""Share of a chord up to which a touch is searched for, a little beyond its end."""


@inner(error_model="numpy", forceinline=True)
def move_to_impact(
    m: Array,
    role: Array,
    row: Array,
    walls: Array,
    obstacles: Array,
    held: int,
    edges: int,
    goal_lines: Array,
    near: Array,
    count: int,
    pairs: Array,
    contacts: Array,
    visits: Array,
    kept: Array,
    n: int,
    left: float,
    h: float,
    safe: float,
    sweeps: bool,
    jam: bool,
) -> tuple[float, bool, bool]:
    """Move all bodies by at most h s, until a new contact begins.

    Existing contacts do not close, because the solver changes the mean velocities.

    Args:
        m: Bodies (N, BODY), moved.
        role: Roles of the bodies (N,).
        row: Coefficients of the world (COEFFICIENTS,).
        walls: Walls, see `arrays.make_walls`.
        obstacles: Obstacles (O, 5), see `arrays.Static`.
        held: Number of edges of all workspaces, which are the first walls.
        edges: Number of edges of one workspace.
        goal_lines: Goal lines (M, 2), see `arrays.make_walls`.
        near: Pairs that can come into contact (count or more, 2).
        count: Number of these pairs.
        pairs: Bodies of each contact (n or more, 2).
        contacts: Contacts (n or more, CONTACT).
        visits: Work space (n or more,).
        kept: Work space (N, 3).
        n: Number of contacts.
        left: Rest of the step, s.
        h: Longest time to move, s.
        safe: Time in which no new contact begins, s.
        sweeps: True to end at the first touch.
        jam: True if paddles have yielded to pucks in this step.

    Returns:
        Three values: the time moved, s; True if ``near`` must be listed again; True if
        paddles have yielded to pucks.
    """
    stale, most, last, tried = False, h, 0.0, h
    if jam:
        slide = WIDE * _longest_slide(m, VX, pairs, contacts, n)
        h = most = min(h, slide)
    for attempt in range(REFINEMENTS):
        _move_freely(m, role, row, left, h)
        hits = False
        for c in range(n):
            i, j = pairs[c, 0], pairs[c, 1]
            speed = closing(m, DX, i, j, contacts[c, NX], contacts[c, NY])
            hits |= speed < -TINY and role[j] != PINNED
        if hits:
            for c in range(n):
                contacts[c, RESTITUTION] = contacts[c, FRICTION] = 0.0
            work = pairs, contacts, visits, kept, n
            jam = solve(m, role, DX, *work, jam)
            stale, safe = True, 0.0
            longest = _longest_slide(m, DX, pairs, contacts, n)
            longest *= 2.0 * WIDE if jam else 1.0
            if longest < h and attempt < REFINEMENTS - 1:
                h = most = longest
                continue
            most = most if jam else h
            fixed = walls, obstacles, held, edges
            count = list_near_drift(m, role, *fixed, most, near)
        if h <= safe or not sweeps or attempt == REFINEMENTS - 1:
            break
        # The chord to a touch differs from the first chord, so the touch may be later.
        # It is searched only a little later, as the search does not converge for slow
        # bodies, and not beyond the time that the pairs were listed for.
        furthest = most / h if jam else min(most / h, LATER)
        chord = m, role, walls, obstacles, goal_lines, near, count, h
        share = _first_touch(*chord, furthest)
        # At the cap on speed, a body moves less than half of `TOUCH` in this time.
        if share == furthest or abs(share - 1.0) * h < 4e-8:
            break
        error = log(max(share, 1e-9))
        if jam and error > 0.0 > last:
            # Bodies under pressure start from rest, so that their paths grow faster
            # than the time. Use the secant of both errors.
            share = max(exp(error * log(h / tried) / (last - error)), 0.1)
        last, tried = error, h
        h = min(max(h * share, 1e-9), most)
    for i in range(len(m)):
        if role[i] == PINNED:
            continue
        m[i, X] += m[i, DX] * h
        m[i, Y] += m[i, DY] * h
        # With constant acceleration, a contact changes the velocity at the end by twice
        # the change of the mean velocity.
        m[i, VX] = m[i, EX] + 2.0 * (m[i, DX] - m[i, CX])
        m[i, VY] = m[i, EY] + 2.0 * (m[i, DY] - m[i, CY])
        m[i, ANGLE] += m[i, SPIN] * h
    return h, stale, jam


@inner(error_model="numpy")
def _longest_slide(m: Array, at: int, pairs: Array, contacts: Array, n: int) -> float:
    """Return the longest move, s, in which sliding discs separate by at most `BOW`.

    The gap grows like the gap between a tangent and its circle. The first column of the
    velocities is ``at``.
    """
    longest = np.inf
    for c in range(n):
        i, j = pairs[c, 0], pairs[c, 1]
        if i >= 0:
            tx, ty = -contacts[c, NY], contacts[c, NX]
            speed = abs(closing(m, at, i, j, tx, ty))
            room = np.sqrt(2.0 * BOW * (m[i, RADIUS] + m[j, RADIUS]))
            longest = min(longest, room / max(speed, 1e-9))
    return float(longest)


@inner(error_model="numpy", forceinline=True)
def _move_freely(m: Array, role: Array, row: Array, left: float, h: float) -> None:
    """Fill the mean and the final velocities of a move without contacts."""
    for i in range(len(m)):
        vx, vy = m[i, VX], m[i, VY]
        if m[i, MASS] == 0.0:
            share = h / left
            m[i, EX] = vx + (m[i, GX] - vx) * share
            m[i, EY] = vy + (m[i, GY] - vy) * share
            m[i, CX], m[i, CY] = 0.5 * (vx + m[i, EX]), 0.5 * (vy + m[i, EY])
        elif role[i] >= AWAY:
            m[i, EX] = m[i, EY] = m[i, CX] = m[i, CY] = 0.0
        else:
            gx, gy = row[PULL_X], row[PULL_Y]
            if role[i] == PUCK:
                x, y, ex, ey = fly(vx, vy, h, gx, gy, row[DAMPING], row[DRAG])
            else:
                x, y, ex, ey = slide(vx, vy, h, gx, gy, row[BLOCK_GRIP])
            m[i, EX], m[i, EY], m[i, CX], m[i, CY] = ex, ey, x / h, y / h
        m[i, DX], m[i, DY] = m[i, CX], m[i, CY]


@inner(error_model="numpy", forceinline=True)
def _first_touch(
    m: Array,
    role: Array,
    walls: Array,
    obstacles: Array,
    goal_lines: Array,
    near: Array,
    count: int,
    h: float,
    first: float,
) -> float:
    """Return the share of h s until two bodies touch or a puck crosses a goal line.

    The result is ``first`` if neither happens before.
    """
    for k in range(count):
        i, j = near[k, 0], near[k, 1]
        if role[j] >= AWAY or (i >= 0 and role[i] >= AWAY):
            continue
        gap, nx, ny = distance_between(m, i, j, walls, obstacles)
        way = closing(m, DX, i, j, nx, ny) * h
        # The distance to a convex object is convex: it decreases fastest at the start.
        if gap + way * first >= 0.0 or in_contact(gap, way / h):
            continue
        if i < 0:
            first = min(first, _touch_fixed(m, j, -1 - i, walls, obstacles, h, first))
            continue
        x, y = (m[j, DX] - m[i, DX]) * h, (m[j, DY] - m[i, DY]) * h
        touch = m[i, RADIUS] + m[j, RADIUS]
        along, between = (gap + touch) * way, gap * (gap + 2.0 * touch)
        root = along * along - (x * x + y * y) * between
        if root > 0.0:
            first = min(first, between / (np.sqrt(root) - along))
    for g in range(len(goal_lines)):
        f = goal_lines[g, 1]
        for i in range(len(m)):
            if f < 0 or role[i] != PUCK:
                continue
            x, y, nx, ny = m[i, X], m[i, Y], walls[f, NORMAL_X], walls[f, NORMAL_Y]
            way = (nx * m[i, DX] + ny * m[i, DY]) * h
            ahead = nx * x + ny * y + walls[f, OFFSET]
            if way < 0.0 < ahead < -way * first:
                share = ahead / -way
                x, y = x + m[i, DX] * h * share, y + m[i, DY] * h * share
                if ahead_of_mouth(x, y, walls, f) < np.inf:
                    first = share
    return first


@inner(error_model="numpy")
def _touch_fixed(
    m: Array, j: int, f: int, walls: Array, obstacles: Array, h: float, most: float
) -> float:
    """Return the share of h s until body j touches a fixed object.

    The result is at least ``most`` if the body does not touch it. Newton's method is
    used, whose steps never pass the first zero of a convex function.
    """
    share, x, y = 0.0, m[j, DX] * h, m[j, DY] * h
    for _ in range(12):
        px, py = m[j, X] + share * x, m[j, Y] + share * y
        gap, nx, ny = distance_to_fixed(px, py, f, walls, obstacles)
        gap -= m[j, RADIUS]
        slope = nx * x + ny * y
        if gap < 1e-9 or slope >= 0.0 or share >= most:
            return share if gap < 1e-9 else np.inf
        share -= gap / slope
    return share
