"""From asked to sent: the one filter between every driver and every paddle.

A sent velocity is within the top speed, within the acceleration of the one before, and
toward an edge of the reach at most what can still brake in front of it, so that no
position is ever clipped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from marl_airhockey.core.seat import ReachPlanes
from marl_airhockey.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array

JERK = 40.0
"""1/s: a jerk is excessive beyond this times the acceleration limit, which is a full
reversal of the acceleration within one 50 ms control step."""


class Sent(NamedTuple):
    """What a filter lets through, and what it held back."""

    velocity: Array
    """(B, S, 2) m/s, reached at the end of the step by a linear ramp"""
    pushed: Array
    """(B, S, 2) m/s2, the acceleration that it takes"""
    excess: Array
    """(B, S, 5) by how much the asked velocity went beyond each limit, zero if not: see
    `EXCESS`"""

    @staticmethod
    def blank(asked: Array) -> Sent:
        """Arrays of any content for what is asked, (B, S, 2)."""
        excess = np.empty((*asked.shape[:-1], len(VIOLATIONS)))
        return Sent(np.empty(asked.shape), np.empty(asked.shape), excess)


VIOLATIONS = ("speed", "acceleration", "jerk", "reach", "cost")
"""Of the asked velocity: m/s, m/s2, m/s3, m/s taken off toward an edge of the reach,
and all of them in units of their limits, summed."""


INFINITE = "action: every element must be finite, got nan or inf"


def limits(
    asked: Array,
    position: Array,
    velocity: Array,
    pushed: Array,
    reach: ReachPlanes,
    speed: Array,
    acceleration: Array,
    dt: float,
) -> Sent:
    """What is sent for what is asked; all but that in the table frame.

    Args:
        action: (B, S, 2) wanted velocity as a fraction of top speed, ego frames.
        position: (B, N, 2) of all bodies, paddles first, m.
        velocity: (B, N, 2) of all bodies, m/s; a paddle's is what was sent last.
        pushed: (B, S, 2) acceleration of the last step, m/s2.
        reach: the seats' reaches.
        speed: (B,) top speed, m/s.
        acceleration: (B,) largest change of velocity, m/s2.
        dt: length of a control step, s.

    Raises:
        ValueError: an asked velocity that is not finite.
    """
    sent = Sent.blank(asked)
    finite = _filter(
        asked,
        position,
        velocity,
        pushed,
        reach.normals,
        reach.offsets,
        reach.share,
        reach.turn,
        reach.passes,
        speed,
        acceleration,
        dt,
        *sent,
    )
    if not finite:
        raise ValueError(INFINITE)
    return sent


def limits_stage(
    asked: Array,
    position: Array,
    velocity: Array,
    pushed: Array,
    reach: ReachPlanes,
    speed: Array,
    acceleration: Array,
    dt: float,
    sent: Sent,
) -> Stage:
    """The same from and into arrays that stay; it stops where it would raise."""
    shared = (reach.normals, reach.offsets, reach.share, reach.turn)
    return Stage(
        _filter,
        (
            *(asked, position, velocity, pushed),
            *map(Fixed, shared),
            *(reach.passes, speed, acceleration, dt),
            *sent,
        ),
        stops=True,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _filter(
    asked: Array,
    position: Array,
    velocity: Array,
    pushed: Array,
    normals: Array,
    offsets: Array,
    share: Array,
    turn: Array,
    passes: int,
    speed: Array,
    acceleration: Array,
    dt: float,
    sent: Array,
    push: Array,
    excess: Array,
) -> bool:
    """`limits` for each seat of each world; False if an asked one is not finite."""
    edges, rate = normals.shape[1], 1.0 / dt
    # The edges that are close, and how fast a paddle may go toward each.
    close, fastest = np.empty(edges, np.int64), np.empty(edges)

    # Functions in place: calls with arrays would cost more than the arithmetic.
    def inside(s: int, count: int, x: float, y: float) -> tuple[float, float]:
        """A velocity with what goes too fast toward an edge taken off."""
        for _ in range(passes):
            for i in range(count):
                nx, ny = normals[s, close[i], 0], normals[s, close[i], 1]
                over = -(nx * x + ny * y) - fastest[i]
                if over > 0.0:
                    x, y = x + over * nx, y + over * ny
        return x, y

    for b in range(asked.shape[0]):
        top, most = speed[b], acceleration[b] * dt
        for s in range(asked.shape[1]):
            ahead, aside = top * asked[b, s, 0], top * asked[b, s, 1]
            ax = turn[s, 0, 0] * ahead + turn[s, 1, 0] * aside
            ay = turn[s, 0, 1] * ahead + turn[s, 1, 1] * aside
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

            # Toward edge k at most h: after this step a full stop must still fit.
            # This step takes (v + h) dt / 2; the stop h^2 / 2a and, in ramped steps,
            # up to h dt / 2 more. It never needs more than the planned deceleration.
            planned = acceleration[b] * share[s]
            inverse = 1.0 / planned
            ample = top * (0.5 * top * inverse + dt)
            px, py, count = position[b, s, 0], position[b, s, 1], 0
            for k in range(edges):
                nx, ny = normals[s, k, 0], normals[s, k, 1]
                closing = -(nx * vx + ny * vy)
                room = nx * px + ny * py + offsets[s, k] - 0.5 * dt * closing
                if room >= ample:
                    continue
                stop = np.sqrt(dt * dt + 2.0 * max(room, 0.0) * inverse)
                h = planned * (stop - dt)
                close[count], fastest[count] = k, max(h, closing - planned * dt)
                count += 1
            sx, sy = inside(s, count, wx, wy)
            if count and (sx - vx) ** 2 + (sy - vy) ** 2 > most * most:
                # Toward pure braking until the change is allowed. Both ends of the way
                # lie inside the (convex) bounds of the edges, so all of it does.
                bx, by = inside(s, count, vx, vy)
                share_of_way = _within(sx - bx, sy - by, bx - vx, by - vy, most)
                sx, sy = bx + share_of_way * (sx - bx), by + share_of_way * (sy - by)
            sent[b, s, 0], sent[b, s, 1] = sx, sy
            push[b, s, 0], push[b, s, 1] = (sx - vx) * rate, (sy - vy) * rate

            jx = dx * rate - pushed[b, s, 0]
            jy = dy * rate - pushed[b, s, 1]
            jolt, rough = jx * jx + jy * jy, JERK * most
            fast = max(norm - top * (1 + 1e-6), 0.0)
            hard = max(change * rate - acceleration[b] * (1 + 1e-6), 0.0)
            # Roots are dear; most worlds need neither.
            jerky = rate * (np.sqrt(jolt) - rough) if jolt > rough * rough else 0.0
            held = np.sqrt((wx - sx) ** 2 + (wy - sy) ** 2) if count else 0.0
            excess[b, s, 0], excess[b, s, 1] = fast, hard
            excess[b, s, 2], excess[b, s, 3] = jerky, held
            cost = (fast + held) / top + (hard + jerky / JERK) / acceleration[b]
            excess[b, s, 4] = cost
    return True


@njit(cache=True, error_model="numpy")
def _within(wx: float, wy: float, dx: float, dy: float, most: float) -> float:
    """The largest share of (wx, wy) with |(dx, dy) + share (wx, wy)| <= most, 0..1."""
    a = max(wx * wx + wy * wy, 1e-18)
    b = dx * wx + dy * wy
    c = dx * dx + dy * dy - most * most
    share = (np.sqrt(max(b * b - a * c, 0.0)) - b) / a
    return float(min(max(share, 0.0), 1.0))
