"""Rewards: measures of a transition that the rules of several scenarios use.

They measure distances and paths of pucks, lifts (pucks that are hit and rise),
possession and saves. All functions are pure and vectorized over leading axes (...).
"""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.contracts.scenario import Transition
from marl_airhockey.sim.core.geometry import length, products
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import reaches
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.core.touches import touched as touched
from marl_airhockey.sim.jit.elementary import cos, exp
from marl_airhockey.types import Array, Memory

SLOW = 0.05
"""Speed below which a puck is at rest, m/s."""
SHOT = 1.0
"""Speed from which a puck that moves into a goal is a shot, m/s."""
CORNER = 0.06
"""Distance of a puck from two walls below which it is in a corner, m."""


def tolerance(value: Array, bound: float, margin: float) -> Array:
    """Return 1 for values up to a bound, and an exponential decrease above it (...).

    The function is modelled on `tolerance` of dm_control.

    Args:
        value: Distances or errors (...), not negative.
        bound: Largest value with the result 1.
        margin: Excess over the bound with the result e^-1.
    """
    return np.asarray(exp(-np.maximum(value - bound, 0.0) / margin))


def nearest(t: Transition) -> Array:
    """Return the shortest distance from paddle 0 to puck 0 before a touch (...), m.

    It is the new value of ``gap`` in the memory. Its decrease rewards movement to the
    puck. It is a running minimum, so moving back and forth gives no reward.
    """
    gap, old = (
        length(t.after.puck[..., 0, :] - t.after.paddle[..., 0, :]),
        t.memory["gap"],
    )
    return np.where(touched(t.new_memory), old, np.minimum(old, gap))


def approach(t: Transition) -> Array:
    """Return the decrease of ``gap`` in the memory (..., 1), m; see `nearest`."""
    return np.asarray((t.memory["gap"] - t.new_memory["gap"])[..., None])


def lost(t: Transition) -> Array:
    """Return True (...) if a puck crossed the first goal line, home."""
    return np.asarray(t.after.crossed[..., 0].any(-1))


def gained(old: Array, new: Array) -> Array:
    """Return the decrease of a shortest distance (...); 0 if the old is infinite."""
    none = np.isinf(old)
    return np.where(none, 0.0, np.where(none, 0.0, old) - np.where(none, 0.0, new))


def alike(
    velocity: Array, wanted: Array, angle: float, share: float, slack: float
) -> Array:
    """Return True (...) where two velocities agree in direction and speed.

    Args:
        velocity: Velocities (..., 2), m/s.
        wanted: Target velocities (..., 2), m/s.
        angle: Largest angle between them, rad.
        share: Largest error of the speed, as a share of the target speed.
        slack: Additional error of the speed, m/s.
    """
    speed, aim = length(velocity), length(wanted)
    along = (velocity * wanted).sum(-1) >= cos(angle) * speed * aim
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
    """Compare the path of puck 0 with a circle, at every substep.

    A substep counts if the puck has been touched and rises (moves away from home).

    Args:
        t: Transition; the state after it has a ``path`` (..., K + 1, movers, 4).
        centre: Centre of the circle (..., 2), table frame, m.
        radius: Radius of the circle, m.
        velocity: Target velocity in the circle (..., 2), m/s; None for any velocity.
        angle: Largest angle to the target velocity, rad.
        speed_share: Largest error of the speed, as a share of the target speed.
        speed_slack: Additional error of the speed, m/s.

    Returns:
        True if the puck was in the circle with the target velocity (...). Distance to
        the circle's edge (..., K + 1), m, which is negative inside and infinite in
        substeps that do not count. Error of the velocity (..., K + 1), m/s.

    Raises:
        ValueError: The state has no path.
    """
    after = t.after
    if after.path is None:
        raise ValueError("enters: the state has no path; give the scene path=True")
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
    """Return x of each puck at its last contact with a paddle (..., pucks), m.

    If the contact continues after the step, it is the current x. Otherwise it is x in
    free flight at the time when the contact began. It is nan without a contact in this
    step.
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
    """Detect pucks that have risen by ``lift``, m, above their last hit.

    Returns:
        Memory of two arrays (..., pucks), and True for pucks that have risen in this
        step (..., pucks). ``armed`` is 1 from a hit until the puck has risen, and
        ``struck_at`` is x of the hit, m.
    """
    height = contact_height(t)
    struck = ~np.isnan(height)
    struck_at = np.where(struck, height, t.memory["struck_at"])
    armed = np.where(struck, 1.0, t.memory["armed"])
    risen = (armed > 0) & (t.after.puck[..., 0] >= struck_at + lift)
    return {"armed": np.where(risen, 0.0, armed), "struck_at": struck_at}, risen


def last_toucher(who: Array, after: State) -> Array:
    """Return the number of the seat that touched each puck last (..., pucks).

    Seats are numbered from 1; 0 means none.

    Args:
        who: Numbers before the step (..., pucks).
        after: State after the step.
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
    """Return the time for which teams have had pucks in reach (..., seats, pucks), s.

    The reach of a team is the reach of any of its seats. The result is the new value of
    ``held`` in the memory.
    """
    dt = (t.after.time - t.before.time)[..., None, None]
    has = in_reach(scene, t.after.puck)
    teams = np.array([seat.team for seat in scene.seats])
    rows = [has[..., teams == seat.team].any(-1) for seat in scene.seats]
    ours = np.stack(rows, axis=-2)
    return np.where(ours, t.memory["held"] + dt, 0.0)


def resting(t: Transition) -> Array:
    """Return the time for which pucks have rested (..., pucks), s.

    A puck rests if it is slower than 0.05 m/s. The result is the new value of ``lying``
    in the memory.
    """
    dt = (t.after.time - t.before.time)[..., None]
    slow = length(t.after.puck_velocity) < SLOW
    return np.where(slow, t.memory["lying"] + dt, 0.0)


def stuck(scene: Scene, t: Transition, clocks: Array) -> Array:
    """Return the time for which pucks have rested where none can play (..., pucks), s.

    These places are those out of reach, and the corners: no paddle gets behind a puck
    there. The result is the new value of ``lying`` in the memory.

    Args:
        scene: Scene of the scenario.
        t: Transition of one step.
        clocks: Result of `held` for the transition (..., seats, pucks), s.
    """
    table = scene.table
    gap = products(t.after.puck, table.normals) + table.offsets - table.puck_radius
    cornered = (gap < CORNER).sum(-1) > 1
    playable = (clocks > 0.0).any(-2) & ~cornered
    return np.where(playable, 0.0, resting(t))


def in_reach(scene: Scene, point: Array) -> Array:
    """Return True (..., seats) if the paddle can touch a puck at (..., 2), m."""
    normals, offsets = reaches(scene.table, scene.seats)
    touch = scene.table.paddle_radius + scene.table.puck_radius
    ahead = (normals * point[..., None, None, :]).sum(-1) + offsets
    inside: Array = np.logical_and.reduce(ahead >= -touch, axis=-1)
    return inside


def on_goal(scene: Scene, state: State, seat: int) -> Array:
    """Return True (..., pucks) for shots that move straight into a seat's goal."""
    side = scene.seats[seat].side
    width = next(g.width for g in scene.goal_lines if g.side == side)
    if width is None:
        raise ValueError(f"seat {seat}: its side has no goal with a width")
    normal, offset = scene.table.normals[side], scene.table.offsets[side]
    along = np.array([-normal[1], normal[0]])
    middle = (sum(scene.table.ends(side)) * along).sum() / 2.0
    place, motion = state.puck, state.puck_velocity
    nearing = -(motion * normal).sum(-1)
    due = ((place * normal).sum(-1) + offset) / np.maximum(nearing, 1e-6)
    aside = (place * along).sum(-1) + due * (motion * along).sum(-1) - middle
    there = (nearing > 0.0) & (np.abs(aside) < width / 2.0)
    return np.asarray(there & (length(motion) >= SHOT))


def saves(scene: Scene, t: Transition, toucher: Array) -> Array:
    """Return the number of shots that each seat stopped (..., seats, seats).

    The last axis is the seat that shot. A seat stops a shot when its paddle touches a
    puck that moved straight into its goal at the start of the step. A seat of another
    team must have touched the puck last.

    Args:
        scene: Scene of the scenario, whose goal lines have widths.
        t: Transition of one step.
        toucher: Number of the seat that touched each puck last before the step
            (..., pucks), see `last_toucher`.
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
