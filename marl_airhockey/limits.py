"""From asked to sent: the one filter between every driver and every paddle.

A sent velocity is within the top speed, within the acceleration of the one before, and
toward an edge of the reach at most what can still brake in front of it, so that no
position is ever clipped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.state import Array
from marl_airhockey.table import Seat, Table, half_planes

JERK = 40.0
"""1/s: a jerk is excessive beyond this times the acceleration limit, which is a full
reversal of the acceleration within one 50 ms control step."""


@dataclass(frozen=True)
class Reach:
    """The reaches of S seats as half-planes of the table frame."""

    normals: Array
    """(S, K, 2) inward unit normals; zero where a seat has fewer edges"""
    offsets: Array
    """(S, K) m; infinite where a seat has fewer edges"""
    share: Array
    """(S,) of the acceleration that may be planned against one edge, so that braking
    against both edges of a corner together stays within it"""
    passes: int
    """Rounds of projection: more than one if any corner is sharper than 90 degrees"""

    @staticmethod
    def of(table: Table, seats: tuple[Seat, ...]) -> Reach:
        """The reaches of the seats of a table."""
        planes = [half_planes(seat.reach) for seat in seats]
        edges = max(len(offsets) for _, offsets in planes)
        normals = np.zeros((len(seats), edges, 2))
        offsets = np.full((len(seats), edges), np.inf)
        share, sharpest = np.ones(len(seats)), 1.0
        for s, (seat, (normal, offset)) in enumerate(zip(seats, planes, strict=True)):
            normals[s, : len(offset)] = normal @ table.rotation(seat.side)
            offsets[s, : len(offset)] = offset
            cosine = np.einsum("kd,kd->k", normal, np.roll(normal, -1, axis=0)).min()
            share[s] = np.sqrt((1 + cosine) / 2)
            sharpest = min(sharpest, cosine)
        return Reach(normals, offsets, share, passes=1 if sharpest > -1e-9 else 12)


@dataclass(frozen=True)
class Excess:
    """By how much the asked velocity went beyond each limit, (..., S), zero if not."""

    speed: Array
    """m/s"""
    acceleration: Array
    """m/s2"""
    jerk: Array
    """m/s3"""
    reach: Array
    """m/s taken off toward an edge of the reach"""


def limits(
    asked: Array,
    position: Array,
    velocity: Array,
    pushed: Array,
    reach: Reach,
    speed: Array,
    acceleration: Array,
    dt: float,
) -> tuple[Array, Excess]:
    """What is sent for what is asked.

    All vectors are in the table frame; the sent velocity is reached at the end of the
    step by a linear ramp.

    Args:
        asked: (..., S, 2) wanted velocity, m/s.
        position: (..., S, 2) of the paddles, m.
        velocity: (..., S, 2) of the paddles, m/s: what was sent last.
        pushed: (..., S, 2) acceleration of the last step, m/s2.
        reach: the seats' reaches.
        speed: (..., S) or (..., 1) top speed, m/s.
        acceleration: (..., S) or (..., 1) largest change of velocity, m/s2.
        dt: length of a control step, s.

    Returns:
        The sent velocity (..., S, 2) and the excess of the asked one.

    Raises:
        ValueError: an asked velocity that is not finite.
    """
    norm = np.sqrt(np.einsum("...d,...d->...", asked, asked))
    if not np.isfinite(norm).all():
        raise ValueError("action: every element must be finite, got nan or inf")
    target = asked * (speed / np.maximum(norm, speed))[..., None]
    change = target - velocity
    size = np.sqrt(np.einsum("...d,...d->...", change, change))
    most = acceleration * dt
    step = change * (most / np.maximum(size, most))[..., None]
    wanted = velocity + step

    # Toward edge k at most h: from the end of this step a full stop must still fit,
    # h^2 / 2a + h dt / 2 for the stop in ramped steps plus (v + h) dt / 2 for this one.
    planned = (acceleration * reach.share)[..., None]
    distance = np.einsum("skd,...sd->...sk", reach.normals, position) + reach.offsets
    closing = -np.einsum("skd,...sd->...sk", reach.normals, velocity)
    room = np.maximum(distance - 0.5 * dt * closing, 0.0)
    fastest = planned * (np.sqrt(dt * dt + 2.0 * room / planned) - dt)
    sent = wanted
    bent = (-np.einsum("skd,...sd->...sk", reach.normals, wanted) > fastest).any()
    if bent:
        # A planned stop never needs more than the planned deceleration.
        fastest = np.maximum(fastest, closing - planned * dt)
        sent = _inside(wanted, reach, fastest)
        sent = _within(sent, velocity, most, reach, fastest)
        cut = wanted - sent
        lost = np.sqrt(np.einsum("...d,...d->...", cut, cut))
    else:
        lost = np.zeros_like(norm)
    jump = change / dt - pushed
    jolt = np.sqrt(np.einsum("...d,...d->...", jump, jump)) / dt
    return sent, Excess(
        speed=np.maximum(norm - speed * (1 + 1e-6), 0.0),
        acceleration=np.maximum(size / dt - acceleration * (1 + 1e-6), 0.0),
        jerk=np.maximum(jolt - JERK * acceleration, 0.0),
        reach=lost,
    )


def _inside(wanted: Array, reach: Reach, fastest: Array) -> Array:
    """The wanted velocity with what goes too fast toward an edge taken off."""
    sent = wanted
    for _ in range(reach.passes):
        for k in range(reach.normals.shape[1]):
            normal = reach.normals[:, k]
            over = -np.einsum("sd,...sd->...s", normal, sent) - fastest[..., k]
            sent = sent + np.maximum(over, 0.0)[..., None] * normal
    return sent


def _within(
    sent: Array, velocity: Array, most: Array, reach: Reach, fastest: Array
) -> Array:
    """``sent`` moved toward pure braking until its change of velocity is allowed.

    Both ends of the way lie inside the (convex) bounds of the edges, so all of it does.
    """
    change = sent - velocity
    size2 = np.einsum("...d,...d->...", change, change)
    most2 = np.broadcast_to(most * most, size2.shape)
    if not (size2 > most2).any():
        return sent
    braking = _inside(velocity, reach, fastest)
    start = braking - velocity
    way = sent - braking
    a = np.maximum(np.einsum("...d,...d->...", way, way), 1e-18)
    b = np.einsum("...d,...d->...", start, way)
    c = np.einsum("...d,...d->...", start, start) - most2
    share = (np.sqrt(np.maximum(b * b - a * c, 0.0)) - b) / a
    share = np.where(size2 > most2, np.clip(share, 0.0, 1.0), 1.0)
    return np.asarray(braking + share[..., None] * way)
