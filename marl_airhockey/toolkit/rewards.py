"""Rewards: measures of a transition that the rules of several scenarios use.

Distances and paths of pucks, lifts (pucks that are hit and rise), possession and saves.
All functions are pure and vectorized over the caller's leading axes.
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.scenario import Transition
from marl_airhockey.sim.core.geometry import length
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import reaches
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.touches import touched as touched
from marl_airhockey.types import Array, Memory

SLOW = 0.05
"""Speed below which a puck is at rest (m/s)."""
SHOT = 1.0
"""Speed from which a puck on its way into a goal is a shot (m/s)."""


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


def approach(t: Transition) -> Array:
    """(..., 1) distance by which paddle 0 came nearer to puck 0 than before, m.

    It is that of ``gap`` in the memory, see `nearest`.
    """
    return np.asarray((t.memory["gap"] - t.new_memory["gap"])[..., None])


def lost(t: Transition) -> Array:
    """(...) bool: a puck crossed the first goal line, home."""
    return np.asarray(t.after.crossed[..., 0].any(-1))


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


def contact_height(t: Transition) -> Array:
    """(..., pucks) x of each puck at its last contact with a paddle in this step, m.

    During a contact it is the present x, else the x in free flight at the time when the
    contact began; nan without a contact.
    """
    at = np.where(t.after.touched > 0, t.after.touched_at, np.nan)
    last = np.fmax.reduce(at, axis=-2)
    hit = t.before.puck[..., 0] + t.before.puck_velocity[..., 0] * last
    return np.where(t.after.touching.any(-2), t.after.puck[..., 0], hit)


def no_lifts(state: State) -> Memory:
    """Return the memory of `lifts` at the start of an episode, arrays (W, pucks)."""
    pucks = state.visible.shape
    return {"armed": np.zeros(pucks), "struck_at": np.full(pucks, -0.5)}


def lifts(t: Transition, lift: float) -> tuple[Memory, Array]:
    """Follow pucks from a hit until they have risen by ``lift`` above it, m.

    Returns:
        New memory: ``armed``, 1 from the hit until then, and ``struck_at``, its x (m);
        and True for pucks that have risen so far in this step. All (..., pucks).
    """
    height = contact_height(t)
    struck = ~np.isnan(height)
    struck_at = np.where(struck, height, t.memory["struck_at"])
    armed = np.where(struck, 1.0, t.memory["armed"])
    risen = (armed > 0) & (t.after.puck[..., 0] >= struck_at + lift)
    return {"armed": np.where(risen, 0.0, armed), "struck_at": struck_at}, risen


def last_toucher(who: Array, after: State) -> Array:
    """(..., pucks) number of the seat that touched each puck last; ``who`` if none did.

    Seats are numbered from 1; 0 means none.
    """
    at = np.where(after.touched > 0, after.touched_at, -1.0)
    at = np.where(after.touching, np.inf, at)
    latest = np.zeros_like(after.puck[..., 0])
    for seat in range(after.bodies.paddles):
        later = at[..., seat, :] > latest
        who = np.where(later, 1.0 + seat, who)
        latest = np.where(later, at[..., seat, :], latest)
    return who


def held(scene: Scene, t: Transition) -> Array:
    """(..., seats, pucks) time a puck has been in reach of a seat or its teammates, s.

    It continues ``held`` of the memory.
    """
    dt = (t.after.time - t.before.time)[..., None, None]
    has = in_reach(scene, t.after.puck)
    teams = np.array([seat.team for seat in scene.seats])
    rows = [has[..., teams == seat.team].any(-1) for seat in scene.seats]
    ours = np.stack(rows, axis=-2)
    return np.where(ours, t.memory["held"] + dt, 0.0)


def lying(t: Transition, clocks: Array) -> Array:
    """(..., pucks) time a puck has been slower than 0.05 m/s out of every reach, s.

    It continues ``lying`` of the memory.

    Args:
        t: transition.
        clocks: result of `held` for it.
    """
    dt = (t.after.time - t.before.time)[..., None]
    lies = (length(t.after.puck_velocity) < SLOW) & ~(clocks > 0.0).any(-2)
    return np.where(lies, t.memory["lying"] + dt, 0.0)


def in_reach(scene: Scene, point: Array) -> Array:
    """(..., seats) bool: each seat's paddle can touch a puck at a point (..., 2)."""
    normals, offsets = reaches(scene.table, scene.seats)
    touch = scene.table.paddle_radius + scene.table.puck_radius
    ahead = (normals * point[..., None, None, :]).sum(-1) + offsets
    inside: Array = np.logical_and.reduce(ahead >= -touch, axis=-1)
    return inside


def on_goal(scene: Scene, state: State, seat: int) -> Array:
    """(..., pucks) bool: the puck flies straight into the goal of a seat's side."""
    side = scene.seats[seat].side
    width = next(g.width for g in scene.goal_lines if g.side == side)
    if width is None:
        raise ValueError(f"seat {seat}: its side has no goal of some width")
    normal, offset = scene.table.normals[side], scene.table.offsets[side]
    along = np.array([-normal[1], normal[0]])
    middle = sum(scene.table.ends(side)) @ along / 2.0
    place, motion = state.puck, state.puck_velocity
    nearing = -(motion * normal).sum(-1)
    due = ((place * normal).sum(-1) + offset) / np.maximum(nearing, 1e-6)
    aside = (place * along).sum(-1) + due * (motion * along).sum(-1) - middle
    there = (nearing > 0.0) & (np.abs(aside) < width / 2.0)
    return np.asarray(there & (length(motion) >= SHOT))


def saves(scene: Scene, t: Transition, toucher: Array) -> Array:
    """(..., seats, seats) number of shots of each seat (last axis) that each stopped.

    A seat stops a shot when its paddle touches a puck that flew straight into its goal
    at the start of the step and that a seat of another team had touched last.

    Args:
        scene: scene of the scenario; its goal lines have widths.
        t: transition.
        toucher: (..., pucks) number of who touched each puck last before the step, from
            1; 0 for nobody. See `last_toucher`.
    """
    rows = []
    for i, keeper in enumerate(scene.seats):
        stopped = (t.after.touched[..., i, :] > 0) & on_goal(scene, t.before, i)
        shots = [
            (stopped & (toucher == 1 + k) & (shooter.team != keeper.team)).sum(-1)
            for k, shooter in enumerate(scene.seats)
        ]
        rows.append(np.stack(shots, axis=-1))
    return 1.0 * np.stack(rows, axis=-2)
