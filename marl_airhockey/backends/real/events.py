"""Events: contacts, banks and crossings between two sightings of a puck.

A camera sees a puck some times a second, and what it hits in between never. So it is
flown on from the older sighting, and back from the newer one: where one of these ways
comes to a paddle or a rail that it moves toward, there was a contact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.core.scene import Scene
from marl_airhockey.types import Array

MOMENTS = 9
"""Moments between two sightings at which ways are looked at"""
MARGIN = 0.004
"""Gap that is a contact, m: what calibration and noise leave open"""


class Track(NamedTuple):
    """Puck at one moment."""

    time: float
    """s"""
    place: Array
    """(2,) m"""
    velocity: Array
    """(2,) m/s"""


class Contacts(NamedTuple):
    """What a puck met between two moments."""

    paddle_at: float
    """Time at which it met the paddle, s; nan if it did not"""
    banks: Array
    """(sides,) bool"""
    velocity: Array
    """(2,) m/s, with which it came"""


def find_contacts(
    scene: Scene, before: Track, after: Track, times: Array, paddle: Array
) -> Contacts:
    """Return what a puck met between two moments.

    Args:
        scene: table and sizes.
        before: the older.
        after: the newer.
        times: (n,) s, at which the paddle was told.
        paddle: (n, 2) its places then, m.
    """
    moments = np.linspace(before.time, after.time, MOMENTS)
    on = before.place + (moments - before.time)[:, None] * before.velocity
    back = after.place + (moments - after.time)[:, None] * after.velocity
    # Each way is believed in the half that is nearer to its sighting.
    half = MOMENTS // 2 + 1
    where = np.stack(
        [np.interp(moments, times, paddle[:, k]) for k in range(2)], axis=1
    )
    near = scene.table.puck_radius + scene.table.paddle_radius + MARGIN
    gap_on = np.linalg.norm(on - where, axis=1) - near
    gap_back = np.linalg.norm(back - where, axis=1) - near
    speed = (where[-1] - where[0]) / max(after.time - before.time, 1e-6)
    closing = ((before.velocity - speed) * (where[0] - before.place)).sum() > 0
    leaving = ((after.velocity - speed) * (after.place - where[-1])).sum() > 0
    met = np.minimum(
        np.where(np.arange(MOMENTS) < half, gap_on, np.inf),
        np.where(np.arange(MOMENTS) >= half - 1, gap_back, np.inf),
    )
    at = float("nan")
    if (met < 0).any() and (closing or leaving):
        at = float(moments[int(np.argmax(met < 0))])
    elif (gap_on < 0).any() and closing and leaving:
        at = float(moments[int(np.argmax(gap_on < 0))])
    table = scene.table
    room_on = on @ table.normals.T + table.offsets - table.puck_radius - MARGIN
    room_back = back @ table.normals.T + table.offsets - table.puck_radius - MARGIN
    toward = -(table.normals @ before.velocity)
    away = table.normals @ after.velocity
    beyond = (room_on[:half].min(0) < 0) | (room_back[half - 1 :].min(0) < 0)
    beyond |= (room_on.min(0) < 0) & (away > 0)
    banks = beyond & (toward > 0) & (away > -1e-3)
    return Contacts(at, banks, before.velocity)
