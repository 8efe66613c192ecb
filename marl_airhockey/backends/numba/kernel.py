"""Kernel of the 2D table: one control step of B worlds in one compiled loop.

A world without a contact in the step is advanced in closed form; any other one substep
by substep by the laws of `contacts`. Both give the same numbers but for rounding, so
that most steps cost only a few distances.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.backends._planar.paddles import follow, separate_paddles
from marl_airhockey.backends._planar.walls import SQUEEZE, slide_out, wall
from marl_airhockey.backends.numba.arrays import (
    BLOCK,
    BLOCK_MASS,
    FADE,
    FALL,
    FRICTION,
    PADDLE,
    PUCK_MASS,
    WALL,
    Batch,
    Commands,
    Events,
    Motion,
    Previous,
    Static,
)
from marl_airhockey.backends.numba.contacts import (
    SLOP,
    bounce,
    cap,
    contact_disc,
    contact_obstacle,
    contact_side,
    friction_share,
    passes_line,
    penetration_correction,
)
from marl_airhockey.backends.numba.free_flight import (
    carry_over,
    find_collisions,
    fly_freely,
)
from marl_airhockey.core.physics import PUCK_SPEED_CAP
from marl_airhockey.types import Array


@njit(cache=True, nogil=True, error_model="numpy")
def advance(
    paddles: int,
    pucks: int,
    blocks: int,
    radius: Array,
    lines: Array,
    goal_lines: Array,
    obstacles: Array,
    control_dt: float,
    substeps: int,
    coefficients: Array,
    command: Array,
    prescribed: Array,
    closed: Array,
    goal: Array,
    imposed: Array,
    lifted: Array,
    previous_position: Array,
    previous_velocity: Array,
    previous_touching: Array,
    previous_time: Array,
    position: Array,
    velocity: Array,
    time: Array,
    touched: Array,
    touched_at: Array,
    touching: Array,
    banked: Array,
    crossed: Array,
    crossed_velocity: Array,
    path: Array,
    push: Array,
    against: Array,
    out: Array,
) -> None:
    """Move B worlds by a control step, in place.

    The arrays of a `Batch` are single arguments: numba is slow to unbox tuples of
    arrays from Python, and Python to build them. ``command``, ``prescribed`` and
    ``closed`` are those of a `contracts.backend.Command`; the next three are filled.
    """
    static = Static(
        *(paddles, pucks, blocks, radius, lines, goal_lines, obstacles),
        *(control_dt, substeps),
    )
    follow(command, prescribed, previous_position, control_dt, goal, imposed, lifted)
    commands = Commands(goal, imposed, lifted, closed)
    previous = Previous(
        previous_position, previous_velocity, previous_touching, previous_time
    )
    motion = Motion(position, velocity, path, push, time)
    events = Events(
        *(touched, touched_at, touching, banked, crossed, crossed_velocity),
        *(against, out),
    )
    batch = Batch(static, coefficients, commands, previous, motion, events)
    carry_over(batch)
    may_collide = np.ones(len(coefficients), np.bool_)
    if motion.path.shape[1] == 0:
        find_collisions(batch, may_collide)
        fly_freely(batch, may_collide)
    if may_collide.any():
        _substeps(batch, may_collide)
    for b in range(len(goal)):
        for i in range(paddles):
            if imposed[b, i]:
                velocity[b, i, 0] = prescribed[b, i, 2]
                velocity[b, i, 1] = prescribed[b, i, 3]


@njit(cache=True, nogil=True, error_model="numpy")
def _substeps(batch: Batch, may_collide: Array) -> None:
    """Move the worlds that may have contacts, substep by substep.

    Each inner function is one phase of a substep; numba inlines them, which saves the
    reference counts of a dozen arrays at every call.
    """
    static, coefficients, commands, _, motion, events = batch
    paddles, pucks, blocks, radius, shared, goal_lines, obstacles = static[:7]
    control_dt, n = static[7:]
    lines = shared.copy()
    goal, prescribed, lifted, closed = commands
    position, velocity, path, pending, _ = motion
    touched, touched_at, touching, banked = events[:4]
    crossed, crossed_velocity, against, out = events[4:]
    first, movers, dt = paddles + pucks, paddles + pucks + blocks, control_dt / n
    # Arrays of one world: positions, velocities, those before this substep's forces,
    # corrections of overlaps; `ramped` is a paddle's velocity so far.
    p, v = np.zeros((movers, 2)), np.zeros((movers, 2))
    was, push = np.zeros((movers, 2)), np.zeros((movers, 2))
    ramped = np.zeros((paddles, 2))
    weight, spring = np.zeros(movers), np.ones(movers)
    away, awake = np.zeros(movers, np.bool_), np.zeros(movers, np.bool_)
    # Pairs that can touch in the rest of the step: bodies and fixed objects, bodies and
    # bodies, and a flag for paddles. Listed again after every contact, which may make
    # a body faster.
    hard = np.zeros((movers * (len(lines) + len(obstacles)), 2), np.int64)
    soft = np.zeros((movers * movers, 2), np.int64)
    reach, fresh_bank = np.zeros(movers), np.zeros((pucks, len(lines)), np.bool_)
    hards, softs = np.zeros(1, np.int64), np.zeros(1, np.int64)
    fresh, crowd = np.zeros(1, np.bool_), np.zeros(1, np.bool_)

    def enter(b: int, leapfrog_offset: float) -> None:
        for m in range(len(goal_lines)):
            side = goal_lines[m, 0]
            lines[side, 5] = 0.0 if closed[b, m] else shared[side, 5]
        for i in range(movers):
            for axis in range(2):
                p[i, axis], v[i, axis] = position[b, i, axis], velocity[b, i, axis]
                push[i, axis] = pending[b, i, axis]
            if i < paddles:
                spring[i], away[i] = coefficients[b, PADDLE], lifted[b, i]
                for axis in range(2):
                    here, there = v[i, axis], goal[b, i, axis]
                    ramped[i, axis] = there if prescribed[b, i] else here
            elif i < first:
                weight[i] = 1.0 / coefficients[b, PUCK_MASS]
                away[i] = out[b, i - paddles]
                # Half a substep ahead of the reported velocity (leapfrog).
                v[i, 0] -= leapfrog_offset
            else:
                weight[i] = 1.0 / coefficients[b, BLOCK_MASS]
                spring[i] = coefficients[b, BLOCK]

    def list_near(b: int, left: int) -> None:
        for i in range(movers):
            most = v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1]
            if i < paddles:
                gx, gy = goal[b, i, 0], goal[b, i, 1]
                most = max(most, gx * gx + gy * gy)
            shift = np.sqrt(push[i, 0] * push[i, 0] + push[i, 1] * push[i, 1])
            reach[i] = radius[i] + shift
            reach[i] += (np.sqrt(most) + left * coefficients[b, FALL]) * left * dt
            awake[i] = i < first or most > 0.0 or shift > 0.0
            awake[i] |= coefficients[b, FALL] > coefficients[b, FRICTION]
        hards[0] = softs[0] = 0
        fresh[0], crowd[0] = True, False
        for i in range(movers):
            x, y = p[i, 0], p[i, 1]
            for j in range(i + 1, paddles):
                dx, dy, most = p[j, 0] - x, p[j, 1] - y, reach[i] + reach[j]
                crowd[0] |= dx * dx + dy * dy < most * most
            for c in range(len(lines) + len(obstacles)):
                if i < paddles or away[i] or not awake[i]:
                    continue
                if c < len(lines):
                    near = lines[c, 0] * x + lines[c, 1] * y + lines[c, 2] < reach[i]
                else:
                    o = c - len(lines)
                    near = contact_obstacle(x, y, reach[i], obstacles, o)[0] > 0.0
                if near:
                    hard[hards[0], 0], hard[hards[0], 1] = i, c
                    hards[0] += 1
                elif i < first and c < len(lines):
                    against[b, i - paddles, c] = False
            for j in range(max(i + 1, paddles), movers):
                dx, dy, most = p[j, 0] - x, p[j, 1] - y, reach[i] + reach[j]
                near = dx * dx + dy * dy < most * most and (awake[i] or awake[j])
                if near and not (away[i] or away[j]):
                    soft[softs[0], 0], soft[softs[0], 1] = i, j
                    softs[0] += 1
                elif i < paddles and j < first:
                    touching[b, i, j - paddles] = False

    def drive(b: int, left: int) -> None:
        for i in range(paddles):
            for axis in range(2):
                ramp = (goal[b, i, axis] - ramped[i, axis]) / left
                v[i, axis] = ramped[i, axis] + 0.5 * ramp
                p[i, axis] += v[i, axis] * dt
                ramped[i, axis] += ramp
        if crowd[0] and separate_paddles(
            p, ramped, prescribed[b], lifted[b], 2 * radius[0]
        ):
            fresh[0] = False
            for i in range(paddles):
                v[i, 0], v[i, 1] = ramped[i, 0], ramped[i, 1]

    def move(b: int) -> None:
        fade, fall = coefficients[b, FADE], coefficients[b, FALL]
        for i in range(movers):
            was[i, 0], was[i, 1] = v[i, 0], v[i, 1]
            if i >= paddles and not away[i]:
                for axis in range(2):
                    p[i, axis] += v[i, axis] * dt + push[i, axis]
                    push[i, axis] = 0.0
                v[i, 0], v[i, 1] = v[i, 0] * fade - fall, v[i, 1] * fade

    def meet_fixed(b: int) -> None:
        fresh_bank[:] = False
        for place in range(hards[0]):
            i, c = hard[place, 0], hard[place, 1]
            if c < len(lines):
                depth, nx, ny = contact_side(p[i, 0], p[i, 1], radius[i], lines, c)
            else:
                o = c - len(lines)
                depth, nx, ny = contact_obstacle(
                    p[i, 0], p[i, 1], radius[i], obstacles, o
                )
            if i < first and c < len(lines):
                k, now = i - paddles, depth > 0.0
                fresh_bank[k, c] = now and not against[b, k, c]
                banked[b, k, c] += fresh_bank[k, c]
                against[b, k, c] = now
            if depth > 0.0:
                fresh[0] = False
                before = nx * was[i, 0] + ny * was[i, 1]
                rest = min(coefficients[b, WALL], spring[i])
                gain = bounce(before, nx * v[i, 0] + ny * v[i, 1], rest)
                back = penetration_correction(depth, nx * push[i, 0] + ny * push[i, 1])
                v[i, 0] += gain * nx
                v[i, 1] += gain * ny
                push[i, 0] += back * nx
                push[i, 1] += back * ny

    def pass_lines(b: int, leapfrog_offset: float) -> None:
        for m in range(len(goal_lines)):
            s, whole = goal_lines[m, 0], goal_lines[m, 1] == 1
            for k in range(pucks):
                i = paddles + k
                if whole:
                    # Crossed by touching the wall, as found for its wall.
                    passed = fresh_bank[k, s]
                else:
                    passed = not away[i] and passes_line(p[i, 0], p[i, 1], lines, s)
                    if passed:
                        out[b, k] = away[i] = True
                if passed:
                    crossed[b, k, m] = True
                    crossed_velocity[b, k, m, 0] = was[i, 0] + leapfrog_offset
                    crossed_velocity[b, k, m, 1] = was[i, 1]

    def meet_each_other(b: int, time: float) -> None:
        for place in range(softs[0]):
            i, j = soft[place, 0], soft[place, 1]
            depth, nx, ny = -1.0, 1.0, 0.0
            if not (away[i] or away[j]):
                dx, dy = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1]
                depth, nx, ny = contact_disc(dx, dy, radius[i] + radius[j])
            if i < paddles and j < first:
                k, touches = j - paddles, depth > 0.0
                if touches and not touching[b, i, k]:
                    touched[b, i, k] += 1
                    touched_at[b, i, k] = time
                touching[b, i, k] = touches
            if depth <= 0.0:
                continue
            fresh[0] = False
            share = weight[i] / (weight[i] + weight[j])
            other = 1.0 - share
            before = nx * (was[j, 0] - was[i, 0]) + ny * (was[j, 1] - was[i, 1])
            now = nx * (v[j, 0] - v[i, 0]) + ny * (v[j, 1] - v[i, 1])
            taken = nx * (push[j, 0] - push[i, 0]) + ny * (push[j, 1] - push[i, 1])
            gain = bounce(before, now, min(spring[i], spring[j]))
            back = penetration_correction(depth, taken)
            v[i, 0] -= gain * share * nx
            v[i, 1] -= gain * share * ny
            v[j, 0] += gain * other * nx
            v[j, 1] += gain * other * ny
            push[i, 0] -= back * share * nx
            push[i, 1] -= back * share * ny
            push[j, 0] += back * other * nx
            push[j, 1] += back * other * ny

    def yield_to_sides() -> None:
        # A body pushed into a wall stays in front of it, as the wall does not yield.
        for place in range(hards[0]):
            i, c = hard[place, 0], hard[place, 1]
            if c < len(lines) and (push[i, 0] != 0.0 or push[i, 1] != 0.0):
                x, y = p[i, 0] + push[i, 0], p[i, 1] + push[i, 1]
                depth, nx, ny = contact_side(x, y, radius[i], lines, c)
                back = max(depth - SLOP, 0.0)
                push[i, 0] += back * nx
                push[i, 1] += back * ny

    def hold_blocks(b: int) -> None:
        for i in range(first, movers):
            speed = np.sqrt(v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1])
            share = friction_share(speed, coefficients[b, FRICTION])
            v[i, 0], v[i, 1] = v[i, 0] * share, v[i, 1] * share

    def settle(b: int, leapfrog_offset: float) -> None:
        for i in range(paddles, first):
            vx, vy = v[i, 0] + leapfrog_offset, v[i, 1]
            share = cap(np.sqrt(vx * vx + vy * vy), PUCK_SPEED_CAP)
            if share < 1.0:
                v[i, 0], v[i, 1] = share * vx - leapfrog_offset, share * vy
            held = False
            for j in range(paddles):
                k = i - paddles
                held |= touching[b, j, k] or touched[b, j, k] > 0
            if held and wall(lines, radius[i], p[i, 0], p[i, 1], SQUEEZE) >= 0:
                touch = radius[0] + radius[i]
                x, y = slide_out(lines, radius[i], p[i, 0], p[i, 1], p[:paddles], touch)
                p[i, 0], p[i, 1] = x, y
                push[i, 0] = push[i, 1] = 0.0

    def record(b: int, moment: int, leapfrog_offset: float) -> None:
        for i in range(path.shape[2]):
            for axis in range(2):
                path[b, moment, i, axis] = p[i, axis]
                speed = ramped[i, axis] if i < paddles else v[i, axis]
                path[b, moment, i, 2 + axis] = speed
            path[b, moment, i, 2] += leapfrog_offset if paddles <= i < first else 0.0

    def finish(b: int, leapfrog_offset: float) -> None:
        for i in range(movers):
            for axis in range(2):
                speed = ramped[i, axis] if i < paddles else v[i, axis]
                position[b, i, axis], velocity[b, i, axis] = p[i, axis], speed
                pending[b, i, axis] = push[i, axis]
        for k in range(pucks):
            velocity[b, paddles + k, 0] += leapfrog_offset
            if out[b, k]:
                velocity[b, paddles + k, 0] = velocity[b, paddles + k, 1] = 0.0

    for b in range(len(coefficients)):
        if not may_collide[b]:
            continue
        leapfrog_offset = 0.5 * coefficients[b, FALL]
        enter(b, leapfrog_offset)
        list_near(b, n)
        if path.shape[1] > 0:
            record(b, 0, leapfrog_offset)
        for step in range(n):
            drive(b, n - step)
            move(b)
            meet_fixed(b)
            pass_lines(b, leapfrog_offset)
            meet_each_other(b, (step + 1) * dt)
            if blocks > 0:
                # Friction acts within a contact, which has to return its share.
                hold_blocks(b)
                meet_each_other(b, (step + 1) * dt)
            yield_to_sides()
            settle(b, leapfrog_offset)
            if not fresh[0]:
                list_near(b, n - step - 1)
            if path.shape[1] > 0:
                record(b, step + 1, leapfrog_offset)
        finish(b, leapfrog_offset)
