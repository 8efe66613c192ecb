"""Profile of one table from fitted physics parameters and measured delays."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.profiles import PROFILES, Range
from marl_airhockey.sim.core.servo import HALF
from marl_airhockey.system_id.table_fit import FittedTable

SERVO_SPREAD = 0.1
"""Half-width of the range of a servo's lag, as a share; its delay is measured with one
motion, and strokes are faster."""


def profile_ranges(
    found: FittedTable, base: str, delays: Mapping[str, Any] | None
) -> dict[str, Range]:
    """Return the ranges of a profile by parameter: intervals of the fitted values.

    Args:
        found: Fitted parameters of the table.
        base: Name of the profile with the other ranges.
        delays: Measured delays, see `read_delays`; None without any.

    Raises:
        ValueError: A value of the delays is missing or wrong.
    """
    ranges: dict[str, Range] = {"puck_damping": (0.0, 0.0)}
    for name, estimate in found.found.items():
        bounds = PARAMETERS[name]
        ranges[name] = max(estimate.low, bounds.low), min(estimate.high, bounds.high)
    if {"tilt", "cross_tilt"} <= found.found.keys():
        # The measured slope replaces the slope in any direction.
        ranges["slope"] = (0.0, 0.0)
    if delays is not None:
        try:
            ranges.update(_measured(base, delays))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"--delays: {error} is missing or wrong") from error
    return ranges


def _measured(base: str, delays: Mapping[str, Any]) -> dict[str, Range]:
    """Return the ranges of measured delays.

    Raises:
        KeyError, TypeError, ValueError: A value is missing or wrong.
    """
    ranges = {}
    if "camera" in delays:
        ranges["observation_delay"] = _extent(delays["camera"])
    if "servo_time" in delays:
        ranges |= {
            name: _extent(delays[name]) for name in ("action_delay", "servo_time")
        }
    elif "arm" in delays:
        dead = sum(PROFILES[base].ranges.get("action_delay", (0.0, 0.0))) / 2
        # A critically damped lag of frequency w has the delay 2 / w, and makes half of
        # a step in the time `HALF` / w.
        half = 0.5 * HALF * max(float(delays["arm"]["mean"]) - dead, 0.0)
        spread = SERVO_SPREAD * half
        ranges["servo_time"] = half - spread, half + spread
    return ranges


def _extent(row: Mapping[str, Any]) -> Range:
    return float(row["least"]), float(row["most"])


def profile_toml(
    found: FittedTable, base: str, delays: Mapping[str, Any] | None, what: str
) -> str:
    """Return the TOML text of a profile with `profile_ranges`, see `load_profile`."""
    ranges = profile_ranges(found, base, delays)
    lines = [f"what = {json.dumps(what)}", f"base = {json.dumps(base)}", "", "[ranges]"]
    lines += [f"{k} = [{low:.6g}, {high:.6g}]" for k, (low, high) in ranges.items()]
    lines += [f"# {name}: {why}" for name, why in found.missing.items()]
    return "\n".join(lines) + "\n"


def read_delays(paths: Iterable[Path]) -> dict[str, Any]:
    """Read the output of ``calibrate delay --json`` and ``calibrate arm --json``.

    Returns:
        All values in one dictionary. ``camera`` and ``arm`` are delays of the first
        command, ``action_delay`` and ``servo_time`` are parameters of the second.

    Raises:
        ValueError: A file does not exist, or has other content.
    """
    found: dict[str, Any] = {}
    for path in paths:
        try:
            given = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise ValueError(f"--delays {path}: {error}") from error
        if not (
            isinstance(given, dict) and ("camera" in given or "servo_time" in given)
        ):
            raise ValueError(
                f"--delays {path}: not the output of calibrate delay --json or "
                "calibrate arm --json"
            )
        found |= given
    return found
