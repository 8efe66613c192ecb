"""Lifts: pucks that are hit and rise, followed in a memory."""

from __future__ import annotations

import numpy as np

from marl_airhockey.contracts.scenario import Transition
from marl_airhockey.core.state import State
from marl_airhockey.types import Array, Memory


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
