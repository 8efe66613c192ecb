"""Detection of paddle contacts and wall bounces between two sightings of a puck.

A camera rarely takes a frame at the moment of a contact. So the puck's path is
extrapolated forward from the older sighting and backward from the newer one. There was
a contact where one of these paths meets a paddle or a rail that the puck moves toward.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.sensing.contacts import MARGIN, MOMENTS, contact_time
from marl_airhockey.types import Array


class MeasuredPuck(NamedTuple):
    """Measured state of the puck at one time."""

    time: float
    """Time of the sighting, s."""
    place: Array
    """Position (2,), table frame, m."""
    velocity: Array
    """Velocity (2,), table frame, m/s."""


class MeasuredContacts(NamedTuple):
    """Contacts of a puck between two times."""

    paddle_at: float
    """Time of the contact with the paddle, s; nan without one."""
    banks: Array
    """True for sides with a wall bounce, bool (sides,)."""
    velocity: Array
    """Velocity (2,) before the contacts, m/s."""


def find_contacts(
    scene: Scene, before: MeasuredPuck, after: MeasuredPuck, times: Array, paddle: Array
) -> MeasuredContacts:
    """Return the contacts of a puck between two sightings.

    Args:
        scene: Table and sizes of the bodies.
        before: Older sighting.
        after: Newer sighting.
        times: Times (n,) of the reported paddle positions, s.
        paddle: Reported positions (n, 2) of the paddle, table frame, m.
    """
    table = scene.table
    first, last = (np.array([t.time, *t.place, *t.velocity]) for t in (before, after))
    near = table.puck_radius + table.paddle_radius
    at = contact_time(first, last, times, paddle, near)
    moments = np.linspace(before.time, after.time, MOMENTS)
    on = before.place + (moments - before.time)[:, None] * before.velocity
    back = after.place + (moments - after.time)[:, None] * after.velocity
    # Each path is trusted in the half that is nearer to its sighting.
    half = MOMENTS // 2 + 1
    room_on = on @ table.normals.T + table.offsets - table.puck_radius - MARGIN
    room_back = back @ table.normals.T + table.offsets - table.puck_radius - MARGIN
    toward = -(table.normals @ before.velocity)
    away = table.normals @ after.velocity
    beyond = (room_on[:half].min(0) < 0) | (room_back[half - 1 :].min(0) < 0)
    beyond |= (room_on.min(0) < 0) & (away > 0)
    banks = beyond & (toward > 0) & (away > -1e-3)
    return MeasuredContacts(at, banks, before.velocity)
