"""What scenarios share when they judge a step: touches, entries, regularising terms.

All functions are pure and vectorised over whatever leading axes the caller has.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.cast import Cast
from marl_airhockey.state import Array, Memory, State
from marl_airhockey.table import reaches

TOUCH_GAP = 0.15
"""s: a touch is distinct if it begins this long after the last contact ended."""
SLOW = 0.05
"""m/s: a slower puck lies."""


def length(vector: Array) -> Array:
    """Euclidean norm of (..., 2) vectors, (...)."""
    x, y = vector[..., 0], vector[..., 1]
    size: Array = np.sqrt(x * x + y * y)
    return size


def tolerance(value: Array, bound: float, margin: float) -> Array:
    """1 where ``value`` is at most ``bound``, falling smoothly to e^-1 at ``margin``.

    The one shape for "close is good" (after the function of that name in dm_control).

    Args:
        value: (...) a distance or an error, not negative.
        bound: up to here it is perfect.
        margin: how far beyond the bound the value has fallen to e^-1.
    """
    return np.exp(-np.maximum(value - bound, 0.0) / margin)


def no_touches(worlds: int, paddles: int, pucks: int) -> Memory:
    """The memory of `count_touches` at the start of an episode."""
    return {
        "touches": np.zeros((worlds, paddles, pucks), np.int64),
        "apart": np.full((worlds, paddles, pucks), np.inf),
        "met": np.zeros(worlds, np.bool_),
    }


def count_touches(memory: Memory, before: State, after: State) -> Memory:
    """Count distinct touches: ``touches`` and ``apart`` (..., paddles, pucks).

    ``apart`` is the time in seconds since the last contact ended, 0 while in contact;
    ``met`` (...) whether there was any touch yet. A puck cradled against the paddle
    earns a single touch.
    """
    dt = (after.time - before.time)[..., None, None]
    began = after.touched > 0
    at = np.where(began, after.touched_at, 0.0)
    distinct = began & (memory["apart"] + at >= TOUCH_GAP)
    apart = np.where(began, dt - at, memory["apart"] + dt)
    return {
        "touches": memory["touches"] + distinct,
        "apart": np.where(after.touching, 0.0, apart),
        "met": memory["met"] | distinct.any((-1, -2)),
    }


def touched(memory: Memory) -> Array:
    """(...) bool: any paddle has touched any puck in this episode."""
    return memory["met"]


def nearest(memory: Memory, after: State) -> Array:
    """(...) shortest distance of paddle 0 to puck 0 up to the first touch, m.

    What it shrank by is the reward for going to the puck; being a best so far, it
    cannot be farmed by going to and fro.
    """
    gap = length(after.puck[..., 0, :] - after.paddle[..., 0, :])
    return np.where(touched(memory), memory["gap"], np.minimum(memory["gap"], gap))


def gained(old: Array, new: Array) -> Array:
    """What a best distance shrank by; nothing as long as there was none (infinite)."""
    none = np.isinf(old)
    return np.where(none, 0.0, np.where(none, 0.0, old) - np.where(none, 0.0, new))


def last_toucher(who: Array, after: State) -> Array:
    """(..., pucks) number of the seat that touched each puck last; ``who`` if none did.

    Numbers count from 1, 0 being nobody.
    """
    at = np.where(after.touched > 0, after.touched_at, -1.0)
    at = np.where(after.touching, np.inf, at)
    latest = np.zeros_like(after.puck[..., 0])
    for seat in range(after.bodies.paddles):
        later = at[..., seat, :] > latest
        who = np.where(later, 1.0 + seat, who)
        latest = np.where(later, at[..., seat, :], latest)
    return who


def held(cast: Cast, old: Array, before: State, after: State) -> Array:
    """(..., seats, pucks) s that a puck has been in reach of a seat or of a mate's."""
    dt = (after.time - before.time)[..., None, None]
    has = in_reach(cast, after.puck)
    teams = np.array([seat.team for seat in cast.seats])
    rows = [has[..., teams == seat.team].any(-1) for seat in cast.seats]
    ours = np.stack(rows, axis=-2)
    return np.where(ours, old + dt, 0.0)


def lying(old: Array, clocks: Array, before: State, after: State) -> Array:
    """(..., pucks) s that a puck has lain, slower than 0.05 m/s, out of every reach.

    Args:
        old: before the step.
        clocks: what `held` gave after it.
        before: the step.
        after: the step.
    """
    dt = (after.time - before.time)[..., None]
    lies = (length(after.puck_velocity) < SLOW) & ~(clocks > 0.0).any(-2)
    return np.where(lies, old + dt, 0.0)


def in_reach(cast: Cast, point: Array) -> Array:
    """(..., seats) bool: each seat's paddle can touch a puck at a point (..., 2)."""
    normals, offsets = reaches(cast.table, cast.seats)
    touch = cast.table.paddle_radius + cast.table.puck_radius
    ahead = (normals * point[..., None, None, :]).sum(-1) + offsets
    inside: Array = np.logical_and.reduce(ahead >= -touch, axis=-1)
    return inside


def alike(
    velocity: Array, wanted: Array, angle: float, share: float, slack: float
) -> Array:
    """(...) bool: two velocities agree in direction and speed.

    Args:
        velocity: (..., 2) m/s.
        wanted: (..., 2) m/s.
        angle: largest angle between them, rad.
        share: largest error of the speed, as a share of the wanted speed.
        slack: this much more, m/s.
    """
    speed, aim = length(velocity), length(wanted)
    along = (velocity * wanted).sum(-1) >= np.cos(angle) * speed * aim
    agree: Array = along & (np.abs(speed - aim) <= share * aim + slack)
    return agree


def contact_height(before: State, after: State) -> Array:
    """(..., pucks) x of each puck where a paddle last met it in this step, m.

    It is where the puck flew to until the contact began, and where it is now while the
    contact lasts; nan if there was none.
    """
    at = np.where(after.touched > 0, after.touched_at, np.nan)
    last = np.fmax.reduce(at, axis=-2)
    met = before.puck[..., 0] + before.puck_velocity[..., 0] * last
    return np.where(after.touching.any(-2), after.puck[..., 0], met)


def no_lifts(worlds: int, pucks: int) -> Memory:
    """The memory of `lifts` at the start of an episode."""
    return {
        "armed": np.zeros((worlds, pucks)),
        "struck_at": np.full((worlds, pucks), -0.5),
    }


def lifts(
    memory: Memory, before: State, after: State, lift: float
) -> tuple[Memory, Array]:
    """Follow pucks from a hit until they have risen by ``lift`` above it, m.

    Returns:
        ``armed``, 1 from the hit until then, and ``struck_at``, its x in m, and
        whether the puck has risen so far in this step, all (..., pucks).
    """
    height = contact_height(before, after)
    struck = ~np.isnan(height)
    struck_at = np.where(struck, height, memory["struck_at"])
    armed = np.where(struck, 1.0, memory["armed"])
    risen = (armed > 0) & (after.puck[..., 0] >= struck_at + lift)
    return {"armed": np.where(risen, 0.0, armed), "struck_at": struck_at}, risen


def enters(
    memory: Memory,
    before: State,
    after: State,
    centre: Array,
    radius: float,
    velocity: Array | None = None,
    angle: float = np.pi,
    speed_share: float = 0.0,
    speed_slack: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Judge the path of puck 0 against a circle, at every substep after a touch.

    Only moments count at which the puck has been touched and rises (moves away from
    home).

    Args:
        memory: of `count_touches`, before this step.
        before: the state before the step.
        after: the state after it, with ``path`` (..., K + 1, movers, 4).
        centre: (..., 2) of the circle, m.
        radius: of the circle, m.
        velocity: (..., 2) wanted velocity in the circle, m/s; None for any.
        angle: largest angle to the wanted velocity, rad.
        speed_share: largest error of the speed, as a share of the wanted speed.
        speed_slack: this much more, m/s.

    Returns:
        ``entered`` (...) bool; ``gap`` (..., K + 1) to the circle's edge in m, infinite
        where a moment does not count; ``error`` (..., K + 1) of the velocity, m/s.

    Raises:
        ValueError: a state without a path.
    """
    if after.path is None:
        raise ValueError("enters: the cast must ask for the path (path=True)")
    puck = after.path[..., after.bodies.paddles, :]
    dt = (after.time - before.time)[..., None]
    moment = dt * np.linspace(0.0, 1.0, puck.shape[-2])
    contact = np.where(after.touched > 0, after.touched_at, np.inf).min((-1, -2))
    counts = touched(memory)[..., None] | (moment >= contact[..., None] - 1e-9)
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


def jitter(before: State, sent: Array, top_speed: Array | float) -> Array:
    """(..., seats) squared change of the sent velocity, in top speeds."""
    change = (sent - before.paddle_velocity) / top_speed
    x, y = change[..., 0], change[..., 1]
    squared: Array = x * x + y * y
    return squared


def turning(before: State, sent: Array) -> Array:
    """(..., seats) sudden change of direction: 0 straight on, 1 for a reversal."""
    old = before.paddle_velocity
    size = length(old) * length(sent)
    along = (old * sent).sum(-1)
    return np.where(size > 1e-6, 0.5 * (1 - along / np.maximum(size, 1e-6)), 0.0)
