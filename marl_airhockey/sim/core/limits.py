"""Limits: the filter between the actions of all drivers and the paddles.

A commanded velocity is within the top speed, and its change is within the largest
acceleration. Toward an edge of the workspace it is at most the speed from which the
paddle can still brake before the edge. Positions are therefore never clipped. An
obstacle counts as an edge through its nearest point. Obstacles are convex, so a paddle
outside that edge does not touch them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.seat import ReachPlanes
from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array

JERK = 40.0
"""Jerk limit divided by the acceleration limit (1/s): a full reversal of the
acceleration within one control step of 50 ms."""


class Limited(NamedTuple):
    """Result of the limits: the command, and the excess of the action over each limit.

    The velocity changes linearly during a step.
    """

    velocity: Array
    """Velocity at the end of the step (B, S, 2), table frame, m/s."""
    acceleration: Array
    """Acceleration during the step (B, S, 2), table frame, m/s2."""
    violation: Array
    """Excess of the action over each limit, 0 within it (B, S, 5), see `VIOLATIONS`."""

    @staticmethod
    def empty(worlds: int, seats: int) -> Limited:
        """Return arrays of zeros for B worlds and S seats."""
        shape = (worlds, seats, 2)
        violation = np.zeros((*shape[:-1], len(VIOLATIONS)))
        return Limited(np.zeros(shape), np.zeros(shape), violation)


VIOLATIONS = ("speed", "acceleration", "jerk", "reach", "cost")
"""Columns of `violation`: excess over the limits of speed (m/s), acceleration (m/s2)
and jerk (m/s3); speed removed toward an edge of the workspace (m/s); and the sum of the
four, each divided by its limit. The removed speed is divided by the top speed."""


INFINITE = "action: every element must be finite, got nan or inf"
"""Error message for an action that is not finite."""


def limits_stage(
    action: Array,
    prescribed: Array,
    before: tuple[Array, Array, Array],
    reach: ReachPlanes,
    top: tuple[Array, Array],
    dt: float,
    after: Limited,
) -> Stage:
    """Return the stage that limits actions. It stops at an action that is not finite.

    All arrays except the actions are in the table frame. The stage reads and writes
    them in place, so they must outlive it. `INFINITE` is the error message.

    Args:
        action: Target velocities (B, S, 2), fraction of top speed, ego frames.
        prescribed: Position and velocity (B, S, 4) of position-driven paddles, m and
            m/s; nan for all others. The velocity is passed on unchanged.
        before: Position (B, N, 2), m, and velocity (B, N, 2), m/s, of all bodies,
            paddles first; acceleration (B, S, 2) in the last step, m/s2. The velocity
            of a paddle is its last command.
        reach: Workspaces of the seats.
        top: Top speed (B,), m/s, and largest acceleration (B,), m/s2.
        dt: Length of a control step, s.
        after: Result, which the stage fills.
    """
    shared = (reach.normals, reach.offsets, reach.share, reach.rotation)
    fixed = map(Fixed, (*shared, reach.obstacles))
    arguments = (action, prescribed, *before, *fixed, reach.passes, *top, dt, *after)
    return Stage(_limit, arguments, stops=True)


@compiled(nogil=True, error_model="numpy")
def _limit(
    action: Array,
    prescribed: Array,
    position: Array,
    velocity: Array,
    last_acceleration: Array,
    normals: Array,
    offsets: Array,
    share: Array,
    rotation: Array,
    obstacles: Array,
    passes: int,
    top_speed: Array,
    top_acceleration: Array,
    dt: float,
    command: Array,
    acceleration: Array,
    violation: Array,
) -> bool:
    """Fill the result for all seats; return False if an action is not finite."""
    edges, rate = normals.shape[1], 1.0 / dt
    # Normals of the edges that are close, and the highest speed toward each.
    most_edges = edges + len(obstacles)
    close_x, close_y = np.empty(most_edges), np.empty(most_edges)
    fastest = np.empty(most_edges)

    # Inner function: a call with arrays would cost more than the arithmetic.
    def inside(count: int, x: float, y: float) -> tuple[float, float]:
        """Remove the part of a velocity that is too fast toward the close edges."""
        for _ in range(passes):
            for i in range(count):
                nx, ny = close_x[i], close_y[i]
                # No branch, because it would be mispredicted too often.
                over = max(-(nx * x + ny * y) - fastest[i], 0.0)
                x, y = x + over * nx, y + over * ny
        return x, y

    for b in range(action.shape[0]):
        top, hardest = top_speed[b], top_acceleration[b]
        most = hardest * dt
        for s in range(action.shape[1]):
            ahead, aside = top * action[b, s, 0], top * action[b, s, 1]
            ax = rotation[s, 0, 0] * ahead + rotation[s, 1, 0] * aside
            ay = rotation[s, 0, 1] * ahead + rotation[s, 1, 1] * aside
            vx, vy = velocity[b, s, 0], velocity[b, s, 1]
            square, norm, fit = ax * ax + ay * ay, top, 1.0
            if not square <= top * top:
                norm = np.sqrt(square)
                if not np.isfinite(norm):
                    return False
                fit = top / norm
            dx, dy = ax * fit - vx, ay * fit - vy
            change = np.sqrt(dx * dx + dy * dy)
            fit = most / max(change, most)
            wx, wy = vx + dx * fit, vy + dy * fit

            # Highest speed h toward edge k: after this step a full stop must still fit.
            # This step takes (v + h) dt / 2. The stop takes h^2 / 2a and, in ramped
            # steps, up to h dt / 2 more. It never needs more than the planned
            # deceleration.
            planned = hardest * share[s]
            inverse = 1.0 / planned
            ample = top * (0.5 * top * inverse + dt)
            px, py, count = position[b, s, 0], position[b, s, 1], 0
            for k in range(most_edges):
                if k < edges:
                    nx, ny = normals[s, k, 0], normals[s, k, 1]
                    room = nx * px + ny * py + offsets[s, k]
                else:
                    nx, ny, room = away(obstacles[k - edges], px, py)
                closing = -(nx * vx + ny * vy)
                room -= 0.5 * dt * closing
                if room >= ample:
                    continue
                stop = np.sqrt(dt * dt + 2.0 * max(room, 0.0) * inverse)
                h = planned * (stop - dt)
                close_x[count], close_y[count] = nx, ny
                fastest[count] = max(h, closing - planned * dt)
                count += 1
            sx, sy = inside(count, wx, wy)
            if count and (sx - vx) ** 2 + (sy - vy) ** 2 > most * most:
                # Interpolate toward pure braking until the change is allowed. Both ends
                # are inside the bounds of the edges. The bounds are convex, so all
                # values between them are inside, too.
                bx, by = inside(count, vx, vy)
                share_of_way = _within(sx - bx, sy - by, bx - vx, by - vy, most)
                sx, sy = bx + share_of_way * (sx - bx), by + share_of_way * (sy - by)
            held = np.sqrt((wx - sx) ** 2 + (wy - sy) ** 2) if count else 0.0
            if not np.isnan(prescribed[b, s, 0]):
                sx, sy = prescribed[b, s, 2], prescribed[b, s, 3]
            command[b, s, 0], command[b, s, 1] = sx, sy
            acceleration[b, s, 0] = (sx - vx) * rate
            acceleration[b, s, 1] = (sy - vy) * rate

            jx = dx * rate - last_acceleration[b, s, 0]
            jy = dy * rate - last_acceleration[b, s, 1]
            jerk, rough = jx * jx + jy * jy, JERK * most
            fast = max(norm - top * (1 + 1e-6), 0.0)
            hard = max(change * rate - hardest * (1 + 1e-6), 0.0)
            # Roots are expensive; most worlds need neither.
            jerky = rate * (np.sqrt(jerk) - rough) if jerk > rough * rough else 0.0
            violation[b, s, 0], violation[b, s, 1] = fast, hard
            violation[b, s, 2], violation[b, s, 3] = jerky, held
            cost = (fast + held) / top + (hard + jerky / JERK) / hardest
            violation[b, s, 4] = cost
    return True


@compiled(error_model="numpy")
def away(obstacle: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the unit vector from an obstacle to a paddle, and the free distance, m.

    Args:
        obstacle: Both ends of an obstacle, and the distance that the centres of paddles
            keep from it (5,), table frame, m.
        x: Position of the paddle's centre along x, table frame, m.
        y: Position of the paddle's centre along y, table frame, m.
    """
    ax, ay = obstacle[2] - obstacle[0], obstacle[3] - obstacle[1]
    along = (x - obstacle[0]) * ax + (y - obstacle[1]) * ay
    share = min(max(along / max(ax * ax + ay * ay, 1e-12), 0.0), 1.0)
    nx, ny = x - obstacle[0] - share * ax, y - obstacle[1] - share * ay
    gap = np.sqrt(nx * nx + ny * ny)
    if gap < 1e-9:
        return 1.0, 0.0, -obstacle[4]
    return nx / gap, ny / gap, gap - obstacle[4]


@inner(error_model="numpy")
def _within(wx: float, wy: float, dx: float, dy: float, most: float) -> float:
    """Return the largest share s in 0..1 with |(dx, dy) + s (wx, wy)| <= most."""
    a = max(wx * wx + wy * wy, 1e-18)
    b = dx * wx + dy * wy
    c = dx * dx + dy * dy - most * most
    share = (np.sqrt(max(b * b - a * c, 0.0)) - b) / a
    return float(min(max(share, 0.0), 1.0))
