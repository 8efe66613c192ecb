"""Distinct contacts of paddles and pucks, counted in a memory."""

from __future__ import annotations

import numpy as np

from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory

TOUCH_GAP = 0.15
"""Shortest time (s) from the end of a contact to a touch that counts as distinct."""


def no_touches(state: State) -> Memory:
    """Return the memory of `count_touches` at the start of an episode, W rows."""
    return {
        "touches": np.zeros_like(state.touched),
        "apart": np.where(state.touching, 0.0, np.inf),
        "any_touch": np.zeros(state.time.shape, np.bool_),
    }


def count_touches(memory: Memory, before: State, after: State) -> Memory:
    """Count distinct touches and return the new memory.

    ``touches`` (..., paddles, pucks) is their number. ``apart`` (..., paddles, pucks)
    is the time since the last contact ended, s, and 0 during a contact. ``any_touch``
    (...) is True after the first touch. A puck that lies on the paddle counts as one
    touch.
    """
    dt = (after.time - before.time)[..., None, None]
    began = after.touched > 0
    at = np.where(began, after.touched_at, 0.0)
    distinct = began & (memory["apart"] + at >= TOUCH_GAP)
    apart = np.where(began, dt - at, memory["apart"] + dt)
    return {
        "touches": memory["touches"] + distinct,
        "apart": np.where(after.touching, 0.0, apart),
        "any_touch": memory["any_touch"] | distinct.any((-1, -2)),
    }


def touched(memory: Memory) -> Array:
    """Return True (...) if any paddle has touched any puck in this episode."""
    return memory["any_touch"]
