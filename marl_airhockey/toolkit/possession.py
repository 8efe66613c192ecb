"""Possession: time in reach of a seat, last toucher, and pucks at rest."""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.scenario import Transition
from marl_airhockey.core.geometry import length
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import reaches
from marl_airhockey.core.state import State
from marl_airhockey.types import Array

SLOW = 0.05
"""Speed below which a puck is at rest (m/s)."""


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
    """(..., seats, pucks) time a puck has been in reach of a seat or its mates, s.

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
