"""Rewards: measures of a transition, with those of touches, lifts, possession, saves.

All functions are pure and vectorised over the caller's leading axes.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.scenario import Transition
from marl_airhockey.core.geometry import length as length
from marl_airhockey.core.touches import count_touches as count_touches
from marl_airhockey.core.touches import no_touches as no_touches
from marl_airhockey.core.touches import touched as touched
from marl_airhockey.toolkit.lifts import contact_height as contact_height
from marl_airhockey.toolkit.lifts import lifts as lifts
from marl_airhockey.toolkit.lifts import no_lifts as no_lifts
from marl_airhockey.toolkit.possession import SLOW as SLOW
from marl_airhockey.toolkit.possession import held as held
from marl_airhockey.toolkit.possession import in_reach as in_reach
from marl_airhockey.toolkit.possession import last_toucher as last_toucher
from marl_airhockey.toolkit.possession import lying as lying
from marl_airhockey.toolkit.saves import saves as saves
from marl_airhockey.types import Array


def tolerance(value: Array, bound: float, margin: float) -> Array:
    """Return 1 where ``value`` is at most ``bound``, falling to e^-1 at ``margin``.

    The fall is smooth; the function follows dm_control's of the same name.

    Args:
        value: distance or error (...), not negative.
        bound: largest value with the result 1.
        margin: excess over the bound with the result e^-1.
    """
    return np.exp(-np.maximum(value - bound, 0.0) / margin)


def nearest(t: Transition) -> Array:
    """(...) shortest distance of paddle 0 to puck 0 up to the first touch, m.

    It continues ``gap`` of the memory. Its decrease rewards moving to the puck; as a
    running minimum it cannot be exploited by moving back and forth.
    """
    gap, old = (
        length(t.after.puck[..., 0, :] - t.after.paddle[..., 0, :]),
        t.memory["gap"],
    )
    return np.where(touched(t.new_memory), old, np.minimum(old, gap))


def gained(old: Array, new: Array) -> Array:
    """(...) decrease of a best distance; 0 while there was none (infinite)."""
    none = np.isinf(old)
    return np.where(none, 0.0, np.where(none, 0.0, old) - np.where(none, 0.0, new))


def alike(
    velocity: Array, wanted: Array, angle: float, share: float, slack: float
) -> Array:
    """(...) bool: True where two velocities agree in direction and speed.

    Args:
        velocity: (..., 2) m/s.
        wanted: (..., 2) m/s.
        angle: largest angle between them, rad.
        share: largest error of the speed, as a share of the wanted speed.
        slack: further error of the speed, m/s.
    """
    speed, aim = length(velocity), length(wanted)
    along = (velocity * wanted).sum(-1) >= np.cos(angle) * speed * aim
    agree: Array = along & (np.abs(speed - aim) <= share * aim + slack)
    return agree


def enters(
    t: Transition,
    centre: Array,
    radius: float,
    velocity: Array | None = None,
    angle: float = np.pi,
    speed_share: float = 0.0,
    speed_slack: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Compare the path of puck 0 with a circle, at every substep after a touch.

    Only substeps count at which the puck has been touched and rises (moves away from
    home).

    Args:
        t: transition; the state after it has a ``path`` (..., K + 1, movers, 4).
        centre: (..., 2) of the circle, m.
        radius: of the circle, m.
        velocity: (..., 2) wanted velocity in the circle, m/s; None for any.
        angle: largest angle to the wanted velocity, rad.
        speed_share: largest error of the speed, as a share of the wanted speed.
        speed_slack: further error of the speed, m/s.

    Returns:
        ``entered`` (...) bool; ``gap`` (..., K + 1) to the circle's edge in m, infinite
        where a substep does not count; ``error`` (..., K + 1) of the velocity, m/s.

    Raises:
        ValueError: a state without a path.
    """
    after = t.after
    if after.path is None:
        raise ValueError("enters: the scene must ask for the path (path=True)")
    puck = after.path[..., after.bodies.paddles, :]
    dt = (after.time - t.before.time)[..., None]
    moment = dt * np.linspace(0.0, 1.0, puck.shape[-2])
    contact = np.where(after.touched > 0, after.touched_at, np.inf).min((-1, -2))
    counts = touched(t.new_memory)[..., None] | (moment >= contact[..., None] - 1e-9)
    counts &= puck[..., 2] > 0
    gap = length(puck[..., :2] - centre[..., None, :]) - radius
    gap = np.where(counts, gap, np.inf)
    inside = gap < 0
    error = np.zeros_like(gap)
    if velocity is not None:
        wanted = velocity[..., None, :]
        error = length(puck[..., 2:] - wanted)
        inside &= alike(puck[..., 2:], wanted, angle, speed_share, speed_slack)
    entered: Array = np.logical_or.reduce(inside, axis=-1)
    return entered, gap, error
