"""Observations of several worlds: an array, or a dictionary with goals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Rows

NOWHERE = np.zeros(0, np.int64)
"""Indices of no worlds."""
Observation = Array | Mapping[str, Array]
"""Array (B, seats, D) float32 or (B, seats, 84, 84, 3) uint8, or dict with goals."""


def duplicate(observation: Observation) -> Observation:
    """Return a copy of an observation with new arrays."""
    if isinstance(observation, np.ndarray):
        return observation.copy()
    return {name: array.copy() for name, array in observation.items()}


def put(observation: Observation, worlds: Array, rows: Observation) -> None:
    """Replace the observations of some worlds, by index (W,), in place."""
    if isinstance(observation, np.ndarray):
        observation[worlds] = rows
    elif isinstance(rows, Mapping):
        for name, array in observation.items():
            array[worlds] = rows[name]


def replaced(source: Mapping[str, Any], seen: State, worlds: Rows) -> dict[str, Array]:
    """Return positions and velocities of all worlds, replaced in some of them."""
    replaced = {}
    for name in ("position", "velocity"):
        replaced[name] = source[name].copy()
        replaced[name][worlds] = getattr(seen, name)
    return replaced
