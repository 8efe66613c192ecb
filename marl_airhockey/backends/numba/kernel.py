"""The 2D table: one control step of B worlds in one compiled loop.

A world in which nothing can meet within the step coasts through it in closed form; any
other is stepped substep by substep by the laws of `discs`. Both give the same numbers
but for rounding, so that most steps cost a few distances.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from marl_airhockey.backends._planar.paddles import meet
from marl_airhockey.backends._planar.walls import SQUEEZE, slip, wall
from marl_airhockey.backends.numba.arrays import (
    BLOCK,
    BLOCK_MASS,
    FADE,
    FALL,
    GRIP,
    PADDLE,
    PUCK_MASS,
    WALL,
    Batch,
    Events,
    Ground,
    Last,
    Motion,
    Order,
)
from marl_airhockey.backends.numba.contacts import (
    SLOP,
    bounce,
    cap,
    meet_disc,
    meet_obstacle,
    meet_side,
    rub,
    take_back,
    through,
)
from marl_airhockey.backends.numba.free_flight import begin, coast, find_busy
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
    law: Array,
    goal: Array,
    prescribed: Array,
    lifted: Array,
    closed: Array,
    last_position: Array,
    last_velocity: Array,
    last_touching: Array,
    last_time: Array,
    position: Array,
    velocity: Array,
    path: Array,
    push: Array,
    time: Array,
    touched: Array,
    touched_at: Array,
    touching: Array,
    crossed: Array,
    crossed_velocity: Array,
    leaning: Array,
    out: Array,
) -> None:
    """Move B worlds by a control step, in place.

    Takes the arrays of a `Batch` one by one: numba is slow to take tuples of arrays
    from Python, and Python to make them.
    """
    ground = Ground(
        paddles,
        pucks,
        blocks,
        radius,
        lines,
        goal_lines,
        obstacles,
        control_dt,
        substeps,
    )
    order = Order(goal, prescribed, lifted, closed)
    last = Last(last_position, last_velocity, last_touching, last_time)
    motion = Motion(position, velocity, path, push, time)
    events = Events(
        touched, touched_at, touching, crossed, crossed_velocity, leaning, out
    )
    batch = Batch(ground, law, order, last, motion, events)
    begin(batch)
    busy = np.ones(len(law), np.bool_)
    if motion.path.shape[1] == 0:
        find_busy(batch, busy)
        coast(batch, busy)
    if busy.any():
        _substeps(batch, busy)


@njit(cache=True, nogil=True, error_model="numpy")
def _substeps(batch: Batch, busy: Array) -> None:
    """The busy worlds, substep by substep.

    The inner functions are one phase of a substep each; numba puts them in place, which
    spares it counting references to a dozen arrays at every call.
    """
    ground, law, order, _, motion, events = batch
    paddles, pucks, blocks, radius, shared, goal_lines, obstacles, control_dt, n = (
        ground
    )
    lines = shared.copy()
    goal, prescribed, lifted, closed = order
    position, velocity, path, pending, _ = motion
    touched, touched_at, touching, crossed, crossed_velocity, leaning, out = events
    first, movers, dt = paddles + pucks, paddles + pucks + blocks, control_dt / n
    # Of one world: places, velocities, those before this substep's forces, ways that
    # take overlaps back; ramped is what a paddle's velocity has become.
    p, v = np.zeros((movers, 2)), np.zeros((movers, 2))
    was, push = np.zeros((movers, 2)), np.zeros((movers, 2))
    ramped = np.zeros((paddles, 2))
    weight, spring = np.zeros(movers), np.ones(movers)
    away, awake = np.zeros(movers, np.bool_), np.zeros(movers, np.bool_)
    # What can meet in what is left of the step: bodies and fixed things, bodies and
    # bodies, and whether any paddles can. Listed anew after every contact, which may
    # make something faster.
    hard = np.zeros((movers * (len(lines) + len(obstacles)), 2), np.int64)
    soft = np.zeros((movers * movers, 2), np.int64)
    reach = np.zeros(movers)
    hards, softs = np.zeros(1, np.int64), np.zeros(1, np.int64)
    fresh, crowd = np.zeros(1, np.bool_), np.zeros(1, np.bool_)

    def enter(b: int, kick: float) -> None:
        for m in range(len(goal_lines)):
            side = goal_lines[m, 0]
            lines[side, 5] = 0.0 if closed[b, m] else shared[side, 5]
        for i in range(movers):
            for axis in range(2):
                p[i, axis], v[i, axis] = position[b, i, axis], velocity[b, i, axis]
                push[i, axis] = pending[b, i, axis]
            if i < paddles:
                spring[i], away[i] = law[b, PADDLE], lifted[b, i]
                for axis in range(2):
                    here, there = v[i, axis], goal[b, i, axis]
                    ramped[i, axis] = there if prescribed[b, i] else here
            elif i < first:
                weight[i], away[i] = 1.0 / law[b, PUCK_MASS], out[b, i - paddles]
                # Half a substep ahead of what is reported (leapfrog).
                v[i, 0] -= kick
            else:
                weight[i], spring[i] = 1.0 / law[b, BLOCK_MASS], law[b, BLOCK]

    def list_near(b: int, left: int) -> None:
        for i in range(movers):
            most = v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1]
            if i < paddles:
                gx, gy = goal[b, i, 0], goal[b, i, 1]
                most = max(most, gx * gx + gy * gy)
            shift = np.sqrt(push[i, 0] * push[i, 0] + push[i, 1] * push[i, 1])
            reach[i] = radius[i] + shift
            reach[i] += (np.sqrt(most) + left * law[b, FALL]) * left * dt
            awake[i] = i < first or most > 0.0 or shift > 0.0
            awake[i] |= law[b, FALL] > law[b, GRIP]
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
                    near = meet_obstacle(x, y, reach[i], obstacles, o)[0] > 0.0
                if near:
                    hard[hards[0], 0], hard[hards[0], 1] = i, c
                    hards[0] += 1
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
        if crowd[0] and meet(p, ramped, prescribed[b], lifted[b], 2 * radius[0]):
            fresh[0] = False
            for i in range(paddles):
                v[i, 0], v[i, 1] = ramped[i, 0], ramped[i, 1]

    def move(b: int) -> None:
        fade, fall = law[b, FADE], law[b, FALL]
        for i in range(movers):
            was[i, 0], was[i, 1] = v[i, 0], v[i, 1]
            if i >= paddles and not away[i]:
                for axis in range(2):
                    p[i, axis] += v[i, axis] * dt + push[i, axis]
                    push[i, axis] = 0.0
                v[i, 0], v[i, 1] = v[i, 0] * fade - fall, v[i, 1] * fade

    def meet_fixed(b: int) -> None:
        for place in range(hards[0]):
            i, c = hard[place, 0], hard[place, 1]
            if c < len(lines):
                depth, nx, ny = meet_side(p[i, 0], p[i, 1], radius[i], lines, c)
            else:
                o = c - len(lines)
                depth, nx, ny = meet_obstacle(p[i, 0], p[i, 1], radius[i], obstacles, o)
            if depth > 0.0:
                fresh[0] = False
                before = nx * was[i, 0] + ny * was[i, 1]
                rest = min(law[b, WALL], spring[i])
                gain = bounce(before, nx * v[i, 0] + ny * v[i, 1], rest)
                back = take_back(depth, nx * push[i, 0] + ny * push[i, 1])
                v[i, 0] += gain * nx
                v[i, 1] += gain * ny
                push[i, 0] += back * nx
                push[i, 1] += back * ny

    def cross(b: int, kick: float) -> None:
        for m in range(len(goal_lines)):
            s, whole = goal_lines[m, 0], goal_lines[m, 1] == 1
            for k in range(pucks):
                i = paddles + k
                x, y = p[i, 0], p[i, 1]
                if away[i]:
                    continue
                if whole:
                    ahead = lines[s, 0] * x + lines[s, 1] * y + lines[s, 2]
                    leans = ahead < radius[i]
                    began = leans and not leaning[b, k, m]
                    leaning[b, k, m] = leans
                else:
                    began = through(x, y, lines, s)
                    out[b, k] = away[i] = began
                if began:
                    crossed[b, k, m] = True
                    crossed_velocity[b, k, m, 0] = was[i, 0] + kick
                    crossed_velocity[b, k, m, 1] = was[i, 1]

    def meet_each_other(b: int, time: float) -> None:
        for place in range(softs[0]):
            i, j = soft[place, 0], soft[place, 1]
            depth, nx, ny = -1.0, 1.0, 0.0
            if not (away[i] or away[j]):
                dx, dy = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1]
                depth, nx, ny = meet_disc(dx, dy, radius[i] + radius[j])
            if i < paddles and j < first:
                k, meets = j - paddles, depth > 0.0
                if meets and not touching[b, i, k]:
                    touched[b, i, k] += 1
                    touched_at[b, i, k] = time
                touching[b, i, k] = meets
            if depth <= 0.0:
                continue
            fresh[0] = False
            share = weight[i] / (weight[i] + weight[j])
            other = 1.0 - share
            before = nx * (was[j, 0] - was[i, 0]) + ny * (was[j, 1] - was[i, 1])
            now = nx * (v[j, 0] - v[i, 0]) + ny * (v[j, 1] - v[i, 1])
            taken = nx * (push[j, 0] - push[i, 0]) + ny * (push[j, 1] - push[i, 1])
            gain = bounce(before, now, min(spring[i], spring[j]))
            back = take_back(depth, taken)
            v[i, 0] -= gain * share * nx
            v[i, 1] -= gain * share * ny
            v[j, 0] += gain * other * nx
            v[j, 1] += gain * other * ny
            push[i, 0] -= back * share * nx
            push[i, 1] -= back * share * ny
            push[j, 0] += back * other * nx
            push[j, 1] += back * other * ny

    def yield_to_sides() -> None:
        # What others push into a wall stays in front of it, as the wall does not yield.
        for place in range(hards[0]):
            i, c = hard[place, 0], hard[place, 1]
            if c < len(lines) and (push[i, 0] != 0.0 or push[i, 1] != 0.0):
                x, y = p[i, 0] + push[i, 0], p[i, 1] + push[i, 1]
                depth, nx, ny = meet_side(x, y, radius[i], lines, c)
                back = max(depth - SLOP, 0.0)
                push[i, 0] += back * nx
                push[i, 1] += back * ny

    def hold_blocks(b: int) -> None:
        for i in range(first, movers):
            speed = np.sqrt(v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1])
            share = rub(speed, law[b, GRIP])
            v[i, 0], v[i, 1] = v[i, 0] * share, v[i, 1] * share

    def settle(b: int, kick: float) -> None:
        for i in range(paddles, first):
            vx, vy = v[i, 0] + kick, v[i, 1]
            share = cap(np.sqrt(vx * vx + vy * vy), PUCK_SPEED_CAP)
            if share < 1.0:
                v[i, 0], v[i, 1] = share * vx - kick, share * vy
            held = False
            for j in range(paddles):
                k = i - paddles
                held |= touching[b, j, k] or touched[b, j, k] > 0
            if held and wall(lines, radius[i], p[i, 0], p[i, 1], SQUEEZE) >= 0:
                touch = radius[0] + radius[i]
                x, y = slip(lines, radius[i], p[i, 0], p[i, 1], p[:paddles], touch)
                p[i, 0], p[i, 1] = x, y
                push[i, 0] = push[i, 1] = 0.0

    def record(b: int, moment: int, kick: float) -> None:
        for i in range(path.shape[2]):
            for axis in range(2):
                path[b, moment, i, axis] = p[i, axis]
                speed = ramped[i, axis] if i < paddles else v[i, axis]
                path[b, moment, i, 2 + axis] = speed
            path[b, moment, i, 2] += kick if paddles <= i < first else 0.0

    def finish(b: int, kick: float) -> None:
        for i in range(movers):
            for axis in range(2):
                speed = ramped[i, axis] if i < paddles else v[i, axis]
                position[b, i, axis], velocity[b, i, axis] = p[i, axis], speed
                pending[b, i, axis] = push[i, axis]
        for k in range(pucks):
            velocity[b, paddles + k, 0] += kick
            if out[b, k]:
                velocity[b, paddles + k, 0] = velocity[b, paddles + k, 1] = 0.0

    for b in range(len(law)):
        if not busy[b]:
            continue
        kick = 0.5 * law[b, FALL]
        enter(b, kick)
        list_near(b, n)
        if path.shape[1] > 0:
            record(b, 0, kick)
        for step in range(n):
            drive(b, n - step)
            move(b)
            meet_fixed(b)
            cross(b, kick)
            meet_each_other(b, (step + 1) * dt)
            if blocks > 0:
                # Friction acts within a contact, which has to give back its share.
                hold_blocks(b)
                meet_each_other(b, (step + 1) * dt)
            yield_to_sides()
            settle(b, kick)
            if not fresh[0]:
                list_near(b, n - step - 1)
            if path.shape[1] > 0:
                record(b, step + 1, kick)
        finish(b, kick)
