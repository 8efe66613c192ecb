"""Fit of a table's physics parameters, corrected by the bias of the fit.

The tracks are simulated with the parameters that a fit finds (`twin.track_twin`), and
the simulated tracks are fitted again. The mean error of this second fit is subtracted.
The interval of a parameter grows by this correction and by its spread over the
simulations. The interval of a slope also grows by the uncertainty of a camera's
calibration.
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
"""Number of simulations of all tracks."""
WITHIN = 1.96
"""Number of standard deviations in half of a 95 % interval."""
CALIBRATION = 5e-4
"""Standard deviation of a camera's scale, as a share, and of its direction, rad: tags
are placed to half a millimetre in a metre. A simulation does not contain this error,
which tilts a slope."""


def fit_corrected(tracks: Sequence[Track], table: Table, seed: int = 0) -> FittedTable:
    """Fit the physics parameters of a table to tracks of its puck, see `fit_table`.

    Args:
        tracks: Tracks of one puck each, on the same table.
        table: Table of the tracks.
        seed: Seed of the noise and of the contact noise in the simulations.
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
            missing[name] = (
                "not identifiable: simulations with the fitted values hide it"
            )
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
        estimate: Estimate of the fit.
        off: Errors (K,) of the fits of simulated tracks.
    """
    bias, spread = float(off.mean()), WITHIN * float(off.std())
    half = float(np.hypot(np.hypot((estimate.high - estimate.low) / 2, spread), bias))
    value = estimate.value - bias
    return Estimate(value, value - half, value + half, estimate.count)


def _widened(estimate: Estimate, deviation: float) -> Estimate:
    """Return an estimate whose interval includes another standard deviation."""
    half = np.hypot((estimate.high - estimate.low) / 2, WITHIN * deviation)
    low, high = estimate.value - float(half), estimate.value + float(half)
    return replace(estimate, low=low, high=high)


def _noise(track: Track) -> float:
    """Return the standard deviation of a position, m, by third differences."""
    off = np.abs(np.diff(track.puck, 3, axis=0))
    return float(np.median(off) / 0.6745 / np.sqrt(20.0))
