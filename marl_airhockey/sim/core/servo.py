"""Servo: paddles follow their commands with the lag of a robot.

It is a critically damped second-order lag of the velocity, so that short strokes lose
some of their top speed and long ones only begin and end later. It stands between the
limits and the physics.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array

HALF = 1.6783469900166605
"""Time in which such a lag makes half of a step, times its frequency: the root of
(1 + x) exp(-x) = 1/2."""


def servo_stage(
    ordered: tuple[Array, Array],
    velocity: Array,
    rate: tuple[Array, Array],
    time: Array,
    top_speed: Array,
    reach: ReachPlanes,
    dt: float,
    action: Array,
) -> Stage:
    """Return the stage that lets paddles lag behind their orders.

    Args:
        ordered: velocities (B, S, 2) that the limits passed in the step before and in
            this one, between which the order is a linear ramp, m/s, table frame.
        velocity: (B, N, 2) m/s of all bodies at the start of the step, paddles first.
        rate: acceleration of the lag (B, S, 2) at the start and, filled, at the end,
            m/s2.
        time: (B,) in which half of a change is made, s; 0 for none.
        top_speed: (B,) m/s.
        reach: its rotations lead to ego frames.
        dt: length of a control step, s.
        action: (B, S, 2), filled: the velocity at the end as an action, a fraction of
            top speed in ego frames, so that limits can keep it within the reach.
    """
    given = (*ordered, velocity, *rate, time, top_speed, Fixed(reach.rotation))
    return Stage(_lag, (*given, dt, action))


@compiled(nogil=True, error_model="numpy")
def _lag(
    before: Array,
    after: Array,
    velocity: Array,
    rate: Array,
    new_rate: Array,
    time: Array,
    top_speed: Array,
    rotation: Array,
    dt: float,
    action: Array,
) -> None:
    """Fill actions and rates with the answer of the lag."""
    answer = np.empty(2)
    for b in range(len(action)):
        w = HALF / time[b] if time[b] > 0.0 else np.inf
        left = np.exp(-w * dt)
        for s in range(action.shape[1]):
            for axis in range(2):
                answer[axis], new_rate[b, s, axis] = follow_ramp(
                    before[b, s, axis],
                    after[b, s, axis],
                    velocity[b, s, axis],
                    rate[b, s, axis],
                    w,
                    left,
                    dt,
                )
            for axis in range(2):
                along = (
                    rotation[s, axis, 0] * answer[0] + rotation[s, axis, 1] * answer[1]
                )
                action[b, s, axis] = along / top_speed[b]


@compiled(nogil=True, error_model="numpy")
def follow_ramp(
    before: float,
    after: float,
    value: float,
    rate: float,
    w: float,
    left: float,
    dt: float,
) -> tuple[float, float]:
    """Return the exact answer of the lag to a ramp, and its rate, after a time dt.

    Args:
        before: order at the start.
        after: order at the end.
        value: of the lag at the start.
        rate: of the lag at the start, per s.
        w: frequency of the lag, `HALF` by its half-rise, 1/s; infinite for no lag.
        left: exp(-w dt), given because many answers share it.
        dt: time, s.
    """
    slope = (after - before) / dt
    late = 2.0 * slope / w
    gap = value - before + late
    bend = rate - slope
    if left > 0.0:
        bend += w * gap
        gap = (gap + bend * dt) * left
        rate = slope + bend * left - w * gap
    else:
        gap, rate = 0.0, slope
    return after - late + gap, rate
