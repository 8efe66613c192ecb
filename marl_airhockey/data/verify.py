"""Verification of recordings: comparison with values computed from the states."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marl_airhockey.data.reader import episodes_of, read_head
from marl_airhockey.data.relabel import batches
from marl_airhockey.registry import DEFAULT_BACKEND, is_live
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.sim.core.recording import Columns, Recording
from marl_airhockey.types import Array

MEASURED = ("clock", "round_trip", "pointer")
"""Columns of recordings of the page that cannot be computed from states."""
EXACT = 1e-9
"""Largest difference that is explained by rounding."""


def replay_differences(path: Path) -> dict[str, float]:
    """Return the largest difference of each column from the value of a replay.

    A column that only one of them has differs by infinity, except for measured columns.

    Raises:
        ValueError: The recording cannot be replayed.
    """
    head, found = read_head(path), dict[str, float]()
    if is_live(head.get("backend", DEFAULT_BACKEND)):
        raise ValueError(
            f"{path}: this is a recording of a real table, whose commands and "
            "observations cannot be computed from the states; remove --replay"
        )
    for batch in batches(episodes_of(path)):
        replayed = Replay(Recording(path, head, batch)).episodes()
        for own, episode in zip(replayed, batch, strict=True):
            for name, off in _differences(own.columns, episode.columns).items():
                found[name] = max(found.get(name, 0.0), off)
    return found


def _differences(one: Columns, other: Columns) -> dict[str, float]:
    return {
        name: distance(one[name], other[name])
        if name in one and name in other
        else np.inf
        for name in one.keys() | other.keys()
        if name not in MEASURED
    }


def distance(one: Array, other: Array) -> float:
    """Return the largest difference of two arrays; inf if only one value is finite."""
    one, other = (np.asarray(x, np.float64) for x in (one, other))
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    with np.errstate(invalid="ignore"):
        off = np.where(same, 0.0, np.abs(one - other))
    return float(np.where(np.isnan(off), np.inf, off).max(initial=0.0))
