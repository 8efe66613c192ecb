"""Verification of recordings: do the rules of today make of them what was recorded?"""

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
"""Columns of play on a page that do not follow from states"""
EXACT = 1e-9
"""Largest difference that rounding explains"""


def replay_differences(path: Path) -> dict[str, float]:
    """Return the largest difference of each column from what a replay computes.

    Columns that only one of both has differ by infinity, but for measured ones.

    Raises:
        ValueError: The recording cannot be replayed; named.
    """
    head, found = read_head(path), dict[str, float]()
    if is_live(head.get("backend", DEFAULT_BACKEND)):
        raise ValueError(
            f"{path}: measured on a real table, where commands and observations do not "
            "follow from the states alone; leave out --replay"
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
    """Return the largest difference; infinite where only one is finite."""
    one, other = (np.asarray(x, np.float64) for x in (one, other))
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    with np.errstate(invalid="ignore"):
        off = np.where(same, 0.0, np.abs(one - other))
    return float(np.where(np.isnan(off), np.inf, off).max(initial=0.0))
