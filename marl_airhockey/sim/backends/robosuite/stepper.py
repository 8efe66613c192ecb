"""Stepper: control step of one world in compiled code that calls MuJoCo."""

from __future__ import annotations

from typing import Any

import numpy as np

from marl_airhockey.sim.backends.robosuite.mujoco_c import (
    full_mass,
    jacobian_rate,
    site_jacobian,
    step1,
    step2,
)
from marl_airhockey.sim.backends.robosuite.osc import subtract_payload, torques
from marl_airhockey.sim.backends.robosuite.reference import reference_motion
from marl_airhockey.sim.backends.robosuite.sliding import apply_laws
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.types import Array

RELEASE = 0.001
"""Distance from a rail up to which a contact of a puck persists, m."""


@compiled(nogil=True)
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
    """Advance a world by a control step; its derived arrays must be up to date.

    Args:
        sim: Views of the world, `SimulationViews`; `refresh` updates its arrays.
        static: Static values, `StaticScene`.
        output: Output of the step, `StepOutput`, filled.
        start: Initial positions of the references (seats, 2), table frame, m.
        old: Initial velocities of the references (seats, 2), table frame, m/s.
        new: Final velocities of the references (seats, 2), table frame, m/s.
        dt: Length of a physics step, s.
        substeps: Number of physics steps.
    """
    seats, nv = len(sim.arms), len(sim.qvel)
    jacobian, rate, mass = np.empty((6, nv)), np.empty((6, nv)), np.empty((nv, nv))
    wanted = np.empty((3, 2))
    output.touched[:], output.touched_at[:], output.crossed[:] = 0, np.nan, False
    output.crossed_velocity[:], output.banked[:] = 0.0, 0
    if len(output.path):
        _record(sim, output, 0)
    for k in range(substeps):
        full_mass(sim.model, mass.ctypes.data, sim.inertia)
        for s in range(seats):
            reference_motion(start[s], old[s], new[s], dt * substeps, dt * k, wanted)
            share = _command_arm(sim, static, s, wanted, mass, jacobian, rate)
            output.trace[k, s, 4] = share
        motion = sim.qpos, sim.qvel, sim.applied
        apply_laws(sim.sliding, output.paddles, *motion, dt)
        step2(sim.model, sim.data)
        for s in range(seats):
            output.trace[k, s, 2] = sim.sensors[sim.arms[s, 5]]
        step1(sim.model, sim.data)
        _measure(sim, static, output, k, jacobian)
        _detect_events(sim, static, output, dt * (k + 1))
        if len(output.path):
            _record(sim, output, k + 1)


@compiled()
def refresh(sim: Any, static: Any, output: Any) -> None:
    """Update derived arrays, paddles and contacts of a world from its positions."""
    step1(sim.model, sim.data)
    _measure(sim, static, output, 0, np.empty((6, len(sim.qvel))))
    _detect_events(sim, static, output, 0.0)


@inner()
def _command_arm(
    sim: Any,
    static: Any,
    s: int,
    wanted: Array,
    mass: Array,
    jacobian: Array,
    rate: Array,
) -> float:
    """Write the torques of an arm to ``ctrl``; return the result of `torques`.

    Args:
        sim: Views of the world, `SimulationViews`.
        static: Static values, `StaticScene`.
        s: Index of the seat.
        wanted: Position (m), velocity (m/s) and acceleration (m/s2) of the reference
            (3, 2), table frame.
        mass: Joint-space inertia (nv, nv).
        jacobian: Work space (6, nv).
        rate: Work space (6, nv).
    """
    _, joint, motor, site, body, _ = sim.arms[s]
    linear, angular = jacobian.ctypes.data, jacobian[3:].ctypes.data
    site_jacobian(sim.model, sim.data, linear, angular, site)
    point = sim.site_positions[site]
    linear, angular = rate.ctypes.data, rate[3:].ctypes.data
    jacobian_rate(sim.model, sim.data, linear, angular, point.ctypes.data, body)
    speeds = sim.qvel[joint : joint + 6]
    drift, out = np.empty(6), np.empty(6)
    for i in range(6):
        drift[i] = 0.0
        for j in range(6):
            drift[i] += rate[i, joint + j] * speeds[j]
    own = jacobian[:, joint : joint + 6].copy()
    inertia = mass[joint : joint + 6, joint : joint + 6].copy()
    bias = sim.bias[joint : joint + 6].copy()
    subtract_payload(sim.payloads[s], sim.gravity, own, drift, inertia, bias)
    share = torques(
        own,
        drift,
        inertia,
        bias,
        speeds,
        _to_table(static, point),
        sim.site_rotations[site].reshape(3, 3),
        static.rotation,
        static.foot_rotations[s],
        wanted,
        sim.gains[s],
        static.low[s],
        static.high[s],
        out,
    )
    for j in range(6):
        sim.ctrl[motor + j] = out[j]
    return share


@inner()
def _to_table(static: Any, point: Array) -> Array:
    """Transform a point (3,) from the world to the table frame, m."""
    found = np.zeros(3)
    for i in range(3):
        for j in range(3):
            found[i] += static.rotation[j, i] * (point[j] - static.origin[j])
    return found


@inner()
def _measure(sim: Any, static: Any, output: Any, k: int, jacobian: Array) -> None:
    """Fill the positions and velocities of the paddles, and row k of the trace."""
    for s in range(len(sim.arms)):
        _, joint, _, site, _, _ = sim.arms[s]
        linear, angular = jacobian.ctypes.data, jacobian[3:].ctypes.data
        site_jacobian(sim.model, sim.data, linear, angular, site)
        position, fastest = _to_table(static, sim.site_positions[site]), 0.0
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
            wanted = static.foot_rotations[s, j, 2]
            upright += wanted * sim.site_rotations[site, 3 * j + 2]
        row = output.trace[k, s]
        row[0], row[3] = position[2], fastest
        row[1] = np.arccos(min(upright, 1.0))
        row[5] = np.hypot(output.paddles[s, 2], output.paddles[s, 3])


@inner()
def _detect_events(sim: Any, static: Any, output: Any, elapsed: float) -> None:
    """Detect new contacts and crossed goal lines at ``elapsed`` s into the step."""
    near = static.radius[0] + static.radius[1]
    for p in range(static.pucks):
        x, y = sim.qpos[sim.movers[p, 0]], sim.qpos[sim.movers[p, 0] + 1]
        vx, vy = sim.qvel[sim.movers[p, 1]], sim.qvel[sim.movers[p, 1] + 1]
        for s in range(len(sim.arms)):
            dx, dy = x - output.paddles[s, 0], y - output.paddles[s, 1]
            touches = dx * dx + dy * dy < near * near
            if touches and not output.touching[s, p]:
                output.touched[s, p] += 1
                output.touched_at[s, p] = elapsed
            output.touching[s, p] = touches
        for s in range(len(static.sides)):
            nx, ny, offset, mx, my, half = static.sides[s]
            aside = nx * (y - my) - ny * (x - mx)
            # The distance of a puck at rest on a rail varies by less than `RELEASE`.
            limit = static.radius[1] + (RELEASE if output.against[p, s] else 0.0)
            touches = nx * x + ny * y + offset < limit and abs(aside) >= half
            if touches and not output.against[p, s]:
                output.banked[p, s] += 1
            output.against[p, s] = touches
        for m in range(len(static.offsets)):
            nx, ny = static.normals[m, 0], static.normals[m, 1]
            inside = nx * x + ny * y + static.offsets[m]
            if static.whole_side[m]:
                past = inside < static.radius[1]
            else:
                a, b = static.openings[m, 0], static.openings[m, 1]
                along = (x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])
                length = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
                past = inside < 0.0 and 0.0 < along < length
            if past and not output.beyond[p, m]:
                output.crossed[p, m] = True
                output.crossed_velocity[p, m, 0] = vx
                output.crossed_velocity[p, m, 1] = vy
            output.beyond[p, m] = past


@inner()
def _record(sim: Any, output: Any, k: int) -> None:
    """Fill row k of the path."""
    seats = len(sim.arms)
    for s in range(seats):
        output.path[k, s] = output.paddles[s]
    for i in range(len(sim.movers)):
        at, dof = sim.movers[i]
        for j in range(2):
            output.path[k, seats + i, j] = sim.qpos[at + j]
            output.path[k, seats + i, 2 + j] = sim.qvel[dof + j]
