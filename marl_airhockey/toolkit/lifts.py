"""Lifts: see the definitions."""

from __future__ import annotations

import numpy as np

from marl_airhockey.core.state import State
from marl_airhockey.types import Array, Memory


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
