"""Servo: lag of paddles behind their commands, as of a robot.

The velocity has a critically damped second-order lag. Short strokes therefore lose some
of their top speed, and long strokes begin and end later. The servo is applied between
the limits and the physics.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.jit.elementary import exp
from marl_airhockey.sim.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array

HALF = 1.6783469900166605
"""Time to 50 % of a step of such a lag, times its frequency: the root of
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
    """Return the stage that lets paddles lag behind their commands.

    Args:
        ordered: Commanded velocities (B, S, 2) after the limits, in the last step and
            in this step, table frame, m/s. The command is a linear ramp between them.
        velocity: Velocities (B, N, 2) of all bodies at the start of the step, paddles
            first, table frame, m/s.
        rate: Accelerations of the lag (B, S, 2) at the start and, filled by the stage,
            at the end, m/s2.
        time: Times to 50 % of a velocity step (B,), s; 0 for no lag.
        top_speed: Top speeds (B,), m/s.
        reach: Workspaces of the seats, whose rotations to ego frames are used.
        dt: Length of a control step, s.
        action: Velocity at the end (B, S, 2), filled by the stage as an action:
            fraction of top speed, ego frames. The limits can then keep it within the
            workspace.
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
    """Fill actions and rates with the response of the lag."""
    answer = np.empty(2)
    for b in range(len(action)):
        w = HALF / time[b] if time[b] > 0.0 else np.inf
        left = exp(-w * dt)
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
    """Return the exact response of the lag to a ramp, and its rate, after a time dt.

    Args:
        before: Command at the start.
        after: Command at the end.
        value: Value of the lag at the start.
        rate: Rate of the lag at the start, per s.
        w: Frequency of the lag, 1/s: `HALF` divided by the time to 50 % of a step.
            Infinite for no lag.
        left: Value of exp(-w dt), which many responses share.
        dt: Duration of the ramp, s.
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
