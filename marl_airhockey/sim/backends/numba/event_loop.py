"""Event loop: worlds in which contacts can occur move from contact to contact.

For each such world, until its control step is over:

1. List the pairs that can come into contact in the rest of the step, if these have
   changed (`broad_phase`).
2. Compute distance and closing speed of each pair. Record contacts that begin and end.
3. If bodies overlap, separate them and continue at 1 (`overlaps`).
4. If contacts close, apply the impulses of all contacts and continue at 1 (`impacts`).
5. Compute the time of the next move. Distances, curves of paths and the rows of the
   recorded path limit it.
6. Move all bodies by this time, or up to the first new contact (`time_of_impact`). The
   smallest impulses keep existing contacts from closing (`contact_solver`).
7. Remove pucks that have crossed a goal line from the game.

After 60 rounds, the rest of the step is divided into at most 50 moves, so that the loop
ends.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.backends.numba.arrays import (
    BLOCK_E,
    BLOCK_MASS,
    HALF,
    PADDLE_E,
    PADDLE_E_SD,
    PADDLE_MU,
    PUCK_E,
    PUCK_MASS,
    PUCK_MU,
    SPIN_SD,
    WALL_E,
    WALL_E_SD,
    WALL_EXIT_SD,
    WALL_MU,
    WALL_SLOPE,
    Batch,
)
from marl_airhockey.sim.backends.numba.bodies import (
    ANGLE,
    ASKS,
    AWAY,
    BLOCK,
    BODY,
    CONTACT,
    EDGE,
    FRICTION,
    GX,
    GY,
    HELD,
    INSIDE,
    KICK,
    MASS,
    NX,
    NY,
    PINNED,
    PRESCRIBED,
    PUCK,
    RADIUS,
    REACH,
    RESTITUTION,
    SPIN,
    TINY,
    VX,
    VY,
    X,
    Y,
    closing,
    distance_between,
    slop,
)
from marl_airhockey.sim.backends.numba.broad_phase import list_pairs, longest_move
from marl_airhockey.sim.backends.numba.geometry import (
    NEAR,
    RELEASE,
    ahead_of_mouth,
    in_contact,
    stays_in_reach,
)
from marl_airhockey.sim.backends.numba.impacts import solve
from marl_airhockey.sim.backends.numba.overlaps import keep_in_reach, take_apart
from marl_airhockey.sim.backends.numba.time_of_impact import move_to_impact
from marl_airhockey.sim.contracts.backend import PATIENCE
from marl_airhockey.sim.core.laws import cap, wall_restitution
from marl_airhockey.sim.core.scatter import at_paddle, at_wall, draw
from marl_airhockey.sim.jit.cache import inner
from marl_airhockey.sim.jit.pipeline import view
from marl_airhockey.types import Array

JAMMED = 3.0
"""Factor of moves in a jam: contacts persist, so paths can be less accurate."""


@inner(error_model="numpy")
def run_events(batch: Batch, active: Array, work: Array, indices: Array) -> None:
    """Move the worlds in which contacts can occur, from contact to contact.

    Each inner function is one phase. Numba inlines them, which saves the reference
    counts of a dozen arrays at every call.
    """
    static, coefficients, commands, previous, result, keys, collisions = batch
    paddles, pucks, blocks, radius, shared, wall_side = static[:6]
    goal_lines, edges, obstacles, control_dt = static[6:]
    held = paddles * edges
    goal, prescribed, raised, closed = commands
    position, velocity, angle, spin = result[:4]
    touched, touched_at, touching, banked = result[5:9]
    crossed, crossed_velocity, lifted, path, against, out, pinned = result[9:]
    first, movers = paddles + pucks, paddles + pucks + blocks
    moments, fixed = max(path.shape[1] - 1, 1), len(shared) + len(obstacles)
    # Arrays of one world: bodies, their roles, pairs that can come into contact, and
    # pairs in contact. They are views of the caller's work space. With arrays of its
    # own, the function would need a sixth of its time to count references.
    size, at = movers * (movers + fixed), work.ctypes.data
    m = view(at, (movers, BODY), np.float64)
    at += 8 * movers * BODY
    kept = view(at, (movers, 3), np.float64)
    at += 8 * movers * 3
    contacts = view(at, (size, CONTACT), np.float64)
    at += 8 * size * CONTACT
    walls = view(at, (len(shared), 7), np.float64)
    # Numba needs seconds to compile an assignment of a whole array.
    for f in range(len(shared)):
        for column in range(shared.shape[1]):
            walls[f, column] = shared[f, column]
    at = indices.ctypes.data
    role = view(at, (movers,), np.int64)
    at += 8 * movers
    near = view(at, (size, 2), np.int64)
    at += 8 * size * 2
    pairs = view(at, (size, 2), np.int64)
    visits = view(at + 8 * size * 2, (size,), np.int64)

    def hold(i: int) -> None:
        # The edges of the workspace limit a paddle whose path leads beyond them.
        half, low, vx, vy = 0.5 * control_dt, i * edges, m[i, VX], m[i, VY]
        late = half * (vx + m[i, GX]), half * (vy + m[i, GY])
        way, place = (half * vx, half * vy, *late), (m[i, X], m[i, Y])
        inside, stays = stays_in_reach(
            *place, way, walls, low, low + edges, m[i, RADIUS]
        )
        m[i, INSIDE], m[i, HELD] = inside, inside and not stays

    def enter(b: int) -> None:
        for g in range(len(goal_lines)):
            f = goal_lines[g, 1]
            if f >= 0:
                walls[f, HALF] = -np.inf if closed[b, g] else shared[f, HALF]
                walls[f + 1, HALF] = np.inf if closed[b, g] else shared[f + 1, HALF]
        for i in range(movers):
            place, motion = previous.position[b, i], previous.velocity[b, i]
            m[i, X], m[i, Y] = place[0], place[1]
            m[i, VX], m[i, VY] = motion[0], motion[1]
            m[i, RADIUS], m[i, ANGLE] = radius[i], previous.angle[b, i]
            m[i, SPIN] = m[i, MASS] = m[i, EDGE] = 0.0
            if i < paddles:
                role[i] = PRESCRIBED if prescribed[b, i] else ASKS
                m[i, GX], m[i, GY] = goal[b, i, 0], goal[b, i, 1]
                m[i, INSIDE] = m[i, HELD] = 0.0
                if prescribed[b, i]:
                    m[i, VX], m[i, VY] = m[i, GX], m[i, GY]
                else:
                    hold(i)
                if raised[b, i]:
                    role[i] = AWAY
                for k in range(pucks):
                    touching[b, i, k] = previous.touching[b, i, k] and not raised[b, i]
            elif i < first:
                role[i] = AWAY if out[b, i - paddles] else PUCK
                m[i, SPIN] = previous.spin[b, i]
                m[i, MASS] = 1.0 / coefficients[b, PUCK_MASS]
                m[i, EDGE] = 2.0 * m[i, MASS]
            else:
                role[i], m[i, MASS] = BLOCK, 1.0 / coefficients[b, BLOCK_MASS]

    def keep_below_the_cap() -> None:
        for i in range(paddles, first):
            share = cap(m[i, VX], m[i, VY])
            if share < 1.0:
                m[i, VX] *= share
                m[i, VY] *= share

    def leave(b: int) -> None:
        keep_in_reach(m, walls, paddles, edges)
        for i in range(movers, position.shape[1]):
            for axis in range(2):
                position[b, i, axis] = previous.position[b, i, axis]
                velocity[b, i, axis] = previous.velocity[b, i, axis]
        for i in range(movers):
            position[b, i, 0], position[b, i, 1] = m[i, X], m[i, Y]
            velocity[b, i, 0], velocity[b, i, 1] = m[i, VX], m[i, VY]
        for k in range(pucks):
            i = paddles + k
            angle[b, i] = m[i, ANGLE]
            pressed = role[i] == PINNED
            for j in range(paddles):
                if role[j] == PRESCRIBED and role[i] == PUCK:
                    gap, _, _ = distance_between(m, j, i, walls, obstacles)
                    pressed |= gap < -RELEASE
            pinned[b, k] = pinned[b, k] + control_dt if pressed else 0.0
            if pinned[b, k] > PATIENCE - 1e-9:
                lifted[b, k] = out[b, k] = True
            if out[b, k]:
                velocity[b, i, 0] = velocity[b, i, 1] = m[i, SPIN] = 0.0
            spin[b, i] = m[i, SPIN]
            for j in range(paddles):
                if touching[b, j, k]:
                    gap, _, _ = distance_between(m, j, i, walls, obstacles)
                    touching[b, j, k] = gap <= RELEASE and not out[b, k]

    def part(b: int, i: int, j: int, gap: float) -> None:
        # Remove a contact that has ended.
        k = j - paddles
        if gap > RELEASE and role[j] == PUCK:
            if 0 <= i < paddles:
                touching[b, i, k] = False
            elif i < 0 and -1 - i < len(walls) and walls[-1 - i, HALF] == -np.inf:
                against[b, k, wall_side[-1 - i]] = False

    def meet(b: int, i: int, j: int, now: float) -> None:
        # Count a contact that begins.
        k = j - paddles
        if role[j] != PUCK or i >= paddles:
            return
        if i >= 0:
            if not touching[b, i, k]:
                touched[b, i, k] += 1
                touched_at[b, i, k] = now
                touching[b, i, k] = True
        elif -1 - i < len(walls):
            side = wall_side[-1 - i]
            if not against[b, k, side]:
                banked[b, k, side] += 1
                against[b, k, side] = True
                for g in range(len(goal_lines)):
                    if goal_lines[g, 0] == side and goal_lines[g, 1] < 0:
                        crossed[b, k, g] = True
                        crossed_velocity[b, k, g, 0] = m[j, VX]
                        crossed_velocity[b, k, g, 1] = m[j, VY]

    def touch(b: int, n: int, i: int, j: int, nx: float, ny: float) -> float:
        # Store a contact with its coefficients, and return its normal speed, m/s.
        row, kick = coefficients[b], 0.0
        speed = closing(m, VX, i, j, nx, ny)
        restitution, friction = row[PUCK_E], row[PUCK_MU]
        if role[j] == BLOCK:
            restitution = row[BLOCK_E]
            friction = friction if i >= 0 and role[i] == PUCK else 0.0
        if 0 <= i < paddles and role[j] == PUCK:
            restitution, friction = row[PADDLE_E], row[PADDLE_MU]
            if row[PADDLE_E_SD] > 0.0 or row[SPIN_SD] > 0.0:
                sample = draw(keys[b], collisions[b], movers * (i + 1) + j)
                sds = row[PADDLE_E_SD], row[SPIN_SD]
                restitution, kick = at_paddle(sample, restitution, *sds)
        if i < 0:
            most = 1.0 if role[j] == PUCK else restitution
            restitution = wall_restitution(-speed, row[WALL_E], row[WALL_SLOPE])
            restitution = min(restitution, most)
            friction = row[WALL_MU] if role[j] == PUCK else 0.0
            scatters = row[WALL_E_SD] > 0.0 or row[WALL_EXIT_SD] > 0.0
            if role[j] == PUCK and scatters:
                sample = draw(keys[b], collisions[b], movers * (movers - i) + j)
                sds = row[WALL_E_SD], row[WALL_EXIT_SD]
                restitution, kick = at_wall(sample, -speed, restitution, *sds)
        pairs[n, 0], pairs[n, 1] = i, j
        contacts[n, NX], contacts[n, NY] = nx, ny
        contacts[n, RESTITUTION], contacts[n, FRICTION] = restitution, friction
        contacts[n, KICK] = kick
        return speed

    def cross(b: int) -> None:
        for g in range(len(goal_lines)):
            for k in range(pucks):
                i = paddles + k
                if goal_lines[g, 1] < 0 or role[i] != PUCK:
                    continue
                ahead = ahead_of_mouth(m[i, X], m[i, Y], walls, goal_lines[g, 1])
                if ahead <= 1e-9:
                    crossed[b, k, g] = out[b, k] = True
                    crossed_velocity[b, k, g, 0] = m[i, VX]
                    crossed_velocity[b, k, g, 1] = m[i, VY]
                    role[i] = AWAY
                    m[i, VX] = m[i, VY] = m[i, SPIN] = 0.0

    def record(b: int, moment: int) -> None:
        for i in range(path.shape[2]):
            path[b, moment, i, 0], path[b, moment, i, 1] = m[i, X], m[i, Y]
            path[b, moment, i, 2], path[b, moment, i, 3] = m[i, VX], m[i, VY]

    for b in range(len(coefficients)):
        if not active[b]:
            continue
        enter(b)
        keep_below_the_cap()
        world = m, role, coefficients[b], walls, obstacles, held, edges
        left, rounds, moment, count = control_dt, 0, 0, 0
        # No bodies overlap before the first move.
        stale, solved, apart, bend, jam = True, False, True, 0.0, False
        while True:
            rounds += 1
            if stale:
                count = list_pairs(*world, left, near)
                bend, stale = longest_move(m, role, near, count), False
            n, hits, deep, safe = 0, False, False, np.inf
            for k in range(count):
                i, j = near[k, 0], near[k, 1]
                gap, nx, ny = distance_between(m, i, j, walls, obstacles)
                now = control_dt - left
                deep |= gap < -1e-9 - slop(role, i, j)
                if in_contact(gap, closing(m, VX, i, j, nx, ny)):
                    meet(b, i, j, now)
                    hits |= touch(b, n, i, j, nx, ny) < -TINY
                    n += 1
                else:
                    part(b, i, j, gap)
                    reach = m[j, REACH] + (m[i, REACH] if i >= 0 else 0.0)
                    safe = min(safe, (gap - 2.0 * NEAR) / max(reach, 1e-9))
            for g in range(len(goal_lines)):
                for i in range(paddles, first):
                    f = goal_lines[g, 1]
                    if f >= 0 and role[i] == PUCK:
                        ahead = ahead_of_mouth(m[i, X], m[i, Y], walls, f)
                        safe = min(safe, max(ahead, 0.0) / max(m[i, REACH], 1e-9))
            if deep and not apart:
                take_apart(m, role, walls, obstacles, held, edges)
                stale = apart = True
                continue
            if hits and not solved:
                some = pairs, contacts, visits, kept, n
                jam = solve(m, role, VX, *some, jam)
                keep_below_the_cap()
                collisions[b] += 1
                stale = solved = True
                continue
            solved = False
            if path.shape[1] > 0 and moment == 0:
                record(b, 0)
                moment = 1
            if left <= 0.0:
                break
            until = left - control_dt * (moments - moment) / moments
            if path.shape[1] == 0:
                until = left
            h = min(max(JAMMED * bend if jam else bend, safe), left, until)
            if rounds > 60:
                h = min(max(h, control_dt / 50), left)
            h, stale, jam = move_to_impact(
                *world,
                goal_lines,
                near,
                count,
                pairs,
                contacts,
                visits,
                kept,
                n,
                left,
                h,
                safe,
                rounds <= 60,
                jam,
            )
            left = left - h if left - h > 1e-12 else 0.0
            cross(b)
            apart = False
            if path.shape[1] > 0 and until - h < 1e-12:
                if left > 0.0:
                    record(b, moment)
                moment += 1
        keep_below_the_cap()
        if path.shape[1] > 0:
            record(b, moments)
        leave(b)
