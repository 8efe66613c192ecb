"""A control step of one world in compiled code: the law, MuJoCo, what happened."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from marl_airhockey.backends.robosuite.mujoco_c import (
    full_mass,
    jacobian_rate,
    site_jacobian,
    step1,
    step2,
)
from marl_airhockey.backends.robosuite.osc import reference, subtract_payload, torques
from marl_airhockey.backends.robosuite.table_physics import slide
from marl_airhockey.types import Array

TRACE = ("height", "tilt", "force", "joint_speed", "share", "speed")
"""Of a paddle at every physics step: m above the table, rad off its orientation, N on
the table, rad/s of the fastest joint, share of the motion that torques allow, m/s."""

REST = 0.001
"""m: a puck that leaves a rail by less than this still touches it."""


class Simulation(NamedTuple):
    """One world's MuJoCo arrays (views, not copies), and where its parts are."""

    model: int
    """Address."""
    data: int
    """Address."""
    inertia: int
    """Address of qM."""
    qpos: Array
    qvel: Array
    applied: Array
    ctrl: Array
    bias: Array
    places: Array
    """(sites, 3)"""
    orientations: Array
    """(sites, 9)"""
    sensors: Array
    arms: Array
    """(seats, 6) first joint's place in qpos, in qvel, in ctrl; site, body, sensor"""
    movers: Array
    """(movers, 2) place in qpos, in qvel"""
    surface: Array
    """(movers, 3) of `surface.Surface.rows`"""
    gravity: Array
    """(3,) m/s2"""
    gains: Array
    """(seats, 8) of `law.Gains`"""
    loads: Array
    """(seats,) kg at the feet, of which the law does not know"""


class StaticScene(NamedTuple):
    """What all worlds share."""

    origin: Array
    rotation: Array
    grips: Array
    """(seats, 3, 3)"""
    low: Array
    """(seats, 6) Nm"""
    high: Array
    radius: Array
    """(2,) of paddle and puck, m"""
    pucks: int
    normals: Array
    """(goal lines, 2) inward, of their sides"""
    offsets: Array
    """(goal lines,) m"""
    ways: Array
    """(goal lines, 2, 2) ends of their openings, m"""
    sides: Array
    """(sides, 6) see `walls.sides`"""
    whole: Array
    """(goal lines,) a whole side, which a puck crosses by touching it"""


class StepOutput(NamedTuple):
    """What a world tells of a step; filled in place."""

    paddles: Array
    """(seats, 4) x, y, vx, vy in the table frame"""
    touched: Array
    touched_at: Array
    touching: Array
    """(seats, pucks), kept from step to step"""
    banked: Array
    """(pucks, sides)"""
    against: Array
    """(pucks, sides) bool: the puck touches the rail of that side, kept"""
    crossed: Array
    crossed_velocity: Array
    beyond: Array
    """(pucks, goal_lines) is past or at the goal line, kept"""
    path: Array
    """(substeps + 1 or 0, movers with paddles, 4)"""
    trace: Array
    """(substeps, seats, len(TRACE))"""


@njit(cache=True, nogil=True)
def advance(
    sim: Any,
    static: Any,
    output: Any,
    start: Array,
    old: Array,
    new: Array,
    dt: float,
    substeps: int,
) -> None:
    """Move a world by a control step; its positions must be fresh (`fresh`).

    Args:
        sim: of the world, `Simulation`.
        static: `StaticScene`.
        output: `Report`, filled.
        start: (seats, 2) where the references begin, m.
        old: (seats, 2) m/s, of the references at the beginning.
        new: (seats, 2) m/s, at the end.
        dt: s of a physics step.
        substeps: how many.
    """
    seats, nv = len(sim.arms), len(sim.qvel)
    jacobian, rate, mass = np.empty((6, nv)), np.empty((6, nv)), np.empty((nv, nv))
    wanted, out, drift = np.empty((3, 2)), np.empty(6), np.empty(6)
    output.touched[:], output.touched_at[:], output.crossed[:] = 0, np.nan, False
    output.crossed_velocity[:], output.banked[:] = 0.0, 0
    if len(output.path):
        _record(sim, output, 0)
    for k in range(substeps):
        full_mass(sim.model, mass.ctypes.data, sim.inertia)
        for s in range(seats):
            _, joint, motor, site, body, _ = sim.arms[s]
            site_jacobian(
                sim.model,
                sim.data,
                jacobian.ctypes.data,
                jacobian[3:].ctypes.data,
                site,
            )
            jacobian_rate(
                sim.model,
                sim.data,
                rate.ctypes.data,
                rate[3:].ctypes.data,
                sim.places[site].ctypes.data,
                body,
            )
            speeds = sim.qvel[joint : joint + 6]
            for i in range(6):
                drift[i] = 0.0
                for j in range(6):
                    drift[i] += rate[i, joint + j] * speeds[j]
            reference(start[s], old[s], new[s], dt * substeps, dt * k, wanted)
            own = jacobian[:, joint : joint + 6].copy()
            inertia = mass[joint : joint + 6, joint : joint + 6].copy()
            bias = sim.bias[joint : joint + 6].copy()
            subtract_payload(sim.loads[s], sim.gravity, own, drift, inertia, bias)
            share = torques(
                own,
                drift,
                inertia,
                bias,
                speeds,
                _local(static, sim.places[site]),
                sim.orientations[site].reshape(3, 3),
                static.rotation,
                static.grips[s],
                wanted,
                sim.gains[s],
                static.low[s],
                static.high[s],
                out,
            )
            for j in range(6):
                sim.ctrl[motor + j] = out[j]
            output.trace[k, s, 4] = share
        slide(sim.surface, sim.movers[:, 1], static.pucks, sim.qvel, sim.applied, dt)
        step2(sim.model, sim.data)
        for s in range(seats):
            output.trace[k, s, 2] = sim.sensors[sim.arms[s, 5]]
        step1(sim.model, sim.data)
        _see(sim, static, output, k, jacobian)
        _events(sim, static, output, dt * (k + 1))
        if len(output.path):
            _record(sim, output, k + 1)


@njit(cache=True)
def fresh(sim: Any, static: Any, output: Any) -> None:
    """Bring a world's derived arrays, paddles and contacts up to its positions."""
    step1(sim.model, sim.data)
    _see(sim, static, output, 0, np.empty((6, len(sim.qvel))))
    _events(sim, static, output, 0.0)


@njit(cache=True)
def _local(static: Any, place: Array) -> Array:
    """(3,) in the table frame."""
    found = np.zeros(3)
    for i in range(3):
        for j in range(3):
            found[i] += static.rotation[j, i] * (place[j] - static.origin[j])
    return found


@njit(cache=True)
def _see(sim: Any, static: Any, output: Any, k: int, jacobian: Array) -> None:
    """Where the paddles are, how fast, and the row of the trace."""
    for s in range(len(sim.arms)):
        _, joint, _, site, _, _ = sim.arms[s]
        site_jacobian(
            sim.model, sim.data, jacobian.ctypes.data, jacobian[3:].ctypes.data, site
        )
        position, fastest = _local(static, sim.places[site]), 0.0
        world = np.zeros(3)
        for j in range(6):
            speed = sim.qvel[joint + j]
            fastest = max(fastest, abs(speed))
            for i in range(3):
                world[i] += jacobian[i, joint + j] * speed
        for i in range(2):
            output.paddles[s, i], output.paddles[s, 2 + i] = position[i], 0.0
            for j in range(3):
                output.paddles[s, 2 + i] += static.rotation[j, i] * world[j]
        upright = 0.0
        for j in range(3):
            upright += static.grips[s, j, 2] * sim.orientations[site, 3 * j + 2]
        row = output.trace[k, s]
        row[0], row[3] = position[2], fastest
        row[1] = np.arccos(min(upright, 1.0))
        row[5] = np.hypot(output.paddles[s, 2], output.paddles[s, 3])


@njit(cache=True)
def _events(sim: Any, static: Any, output: Any, elapsed: float) -> None:
    """Contacts that begin and goal lines that are crossed."""
    near = static.radius[0] + static.radius[1]
    for p in range(static.pucks):
        x, y = sim.qpos[sim.movers[p, 0]], sim.qpos[sim.movers[p, 0] + 1]
        vx, vy = sim.qvel[sim.movers[p, 1]], sim.qvel[sim.movers[p, 1] + 1]
        for s in range(len(sim.arms)):
            dx, dy = x - output.paddles[s, 0], y - output.paddles[s, 1]
            meets = dx * dx + dy * dy < near * near
            if meets and not output.touching[s, p]:
                output.touched[s, p] += 1
                output.touched_at[s, p] = elapsed
            output.touching[s, p] = meets
        for s in range(len(static.sides)):
            nx, ny, offset, mx, my, half = static.sides[s]
            aside = nx * (y - my) - ny * (x - mx)
            # What rests on a rail sinks into it and rises by less than this.
            near = static.radius[1] + (REST if output.against[p, s] else 0.0)
            leans = nx * x + ny * y + offset < near and abs(aside) >= half
            if leans and not output.against[p, s]:
                output.banked[p, s] += 1
            output.against[p, s] = leans
        for m in range(len(static.offsets)):
            nx, ny = static.normals[m, 0], static.normals[m, 1]
            inside = nx * x + ny * y + static.offsets[m]
            if static.whole[m]:
                past = inside < static.radius[1]
            else:
                a, b = static.ways[m, 0], static.ways[m, 1]
                along = (x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])
                length = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
                past = inside < 0.0 and 0.0 < along < length
            if past and not output.beyond[p, m]:
                output.crossed[p, m] = True
                output.crossed_velocity[p, m, 0] = vx
                output.crossed_velocity[p, m, 1] = vy
            output.beyond[p, m] = past


@njit(cache=True)
def _record(sim: Any, output: Any, k: int) -> None:
    """A row of the path."""
    seats = len(sim.arms)
    for s in range(seats):
        output.path[k, s] = output.paddles[s]
    for i in range(len(sim.movers)):
        place, speed = sim.movers[i]
        for j in range(2):
            output.path[k, seats + i, j] = sim.qpos[place + j]
            output.path[k, seats + i, 2 + j] = sim.qvel[speed + j]
