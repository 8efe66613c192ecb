"""Fit of a table's laws, corrected by what it makes of twins.

The laws that a fit finds are given to twins of the tracks (`twin.track_twin`), and what
the fit makes of these, against what they were made with, is taken off. An interval
grows by that correction and by its scatter over the twins, that of a slope also by what
a camera's calibration leaves open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from marl_airhockey.sim.core.table import Table
from marl_airhockey.system_id.table_fit import Estimate, FittedTable, fit_table
from marl_airhockey.system_id.track import Track
from marl_airhockey.system_id.twin import track_twin
from marl_airhockey.types import Array

TWINS = 3
"""Number of twins of all tracks"""
WITHIN = 1.96
"""Standard deviations in half of a 95 % interval"""
CALIBRATION = 5e-4
"""Standard deviation of a camera's scale, as a share, and of its direction, rad: tags
are laid to half a millimetre in a metre. No twin shows it, and it tilts a slope."""


def fit_corrected(tracks: Sequence[Track], table: Table, seed: int = 0) -> FittedTable:
    """Fit the laws of a table to tracks of its puck, see `fit_table`.

    Args:
        tracks: of one puck each, of the same table.
        table: that they are of.
        seed: of the twins' noise and scatter.
    """
    raw = fit_table(list(tracks), table)
    laws = {name: estimate.value for name, estimate in raw.found.items()}
    noise = float(np.median([_noise(track) for track in tracks]))
    rng = np.random.default_rng(seed)
    laws["puck_damping"] = 0.0
    twins = []
    for _ in range(TWINS):
        made = [track_twin(track, table, laws, noise, rng) for track in tracks]
        twins.append(fit_table(made, table).found)
    found: dict[str, Estimate] = {}
    missing = dict(raw.missing)
    for name, estimate in raw.found.items():
        seen = [twin[name].value for twin in twins if name in twin]
        if len(seen) < 2:
            missing[name] = "not identifiable: a table with what was found hides it"
        else:
            found[name] = _corrected(estimate, np.array(seen) - estimate.value)
    for name in {"tilt", "cross_tilt"} & found.keys():
        found[name] = _widened(found[name], CALIBRATION * abs(laws.get("tilt", 0.0)))
    by_side = raw.by_side
    if "wall_restitution" in found:
        shift = found["wall_restitution"].value - laws["wall_restitution"]
        by_side = {side: _shifted(e, shift) for side, e in raw.by_side.items()}
    return FittedTable(found, by_side, missing)


def _shifted(estimate: Estimate, by: float) -> Estimate:
    low, high = estimate.low + by, estimate.high + by
    return replace(estimate, value=estimate.value + by, low=low, high=high)


def _corrected(estimate: Estimate, off: Array) -> Estimate:
    """Return an estimate without its bias.

    Args:
        estimate: as it was fitted.
        off: (K,) by how much twins were found off what they were made with.
    """
    bias, spread = float(off.mean()), WITHIN * float(off.std())
    half = float(np.hypot(np.hypot((estimate.high - estimate.low) / 2, spread), bias))
    value = estimate.value - bias
    return Estimate(value, value - half, value + half, estimate.count)


def _widened(estimate: Estimate, deviation: float) -> Estimate:
    """Return an estimate whose interval has another standard deviation in it."""
    half = np.hypot((estimate.high - estimate.low) / 2, WITHIN * deviation)
    low, high = estimate.value - float(half), estimate.value + float(half)
    return replace(estimate, low=low, high=high)


def _noise(track: Track) -> float:
    """Return the standard deviation of a place, m, by third differences."""
    off = np.abs(np.diff(track.puck, 3, axis=0))
    return float(np.median(off) / 0.6745 / np.sqrt(20.0))
