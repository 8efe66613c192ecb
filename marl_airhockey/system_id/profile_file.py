"""Profile of one table: laws that were fitted and delays that were measured."""

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
"""Half-width of the range of a servo's lag, as a share: its delay is that of one
motion, and strokes are faster"""


def profile_ranges(
    found: FittedTable, base: str, delays: Mapping[str, Any] | None
) -> dict[str, Range]:
    """Return the ranges of a profile by parameter: intervals of what was found.

    Args:
        found: laws of the table.
        base: name of the profile that has the rest.
        delays: see `read_delays`; None for none.

    Raises:
        ValueError: delays that lack something.
    """
    ranges: dict[str, Range] = {"puck_damping": (0.0, 0.0)}
    for name, estimate in found.found.items():
        bounds = PARAMETERS[name]
        ranges[name] = max(estimate.low, bounds.low), min(estimate.high, bounds.high)
    if {"tilt", "cross_tilt"} <= found.found.keys():
        # A slope in any direction stood for what is known now.
        ranges["slope"] = (0.0, 0.0)
    if delays is not None:
        try:
            ranges.update(_measured(base, delays))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"--delays: {error} is missing or wrong") from error
    return ranges


def _measured(base: str, delays: Mapping[str, Any]) -> dict[str, Range]:
    """Return the ranges that delays tell.

    Raises:
        KeyError, TypeError, ValueError: they lack something.
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
        # A critically damped lag of frequency w is 2 / w late, half done at `HALF` / w.
        half = 0.5 * HALF * max(float(delays["arm"]["mean"]) - dead, 0.0)
        spread = SERVO_SPREAD * half
        ranges["servo_time"] = half - spread, half + spread
    return ranges


def _extent(row: Mapping[str, Any]) -> Range:
    return float(row["least"]), float(row["most"])


def profile_toml(
    found: FittedTable, base: str, delays: Mapping[str, Any] | None, what: str
) -> str:
    """Return the TOML of a profile of some `profile_ranges`, see `load_profile`."""
    ranges = profile_ranges(found, base, delays)
    lines = [f"what = {json.dumps(what)}", f"base = {json.dumps(base)}", "", "[ranges]"]
    lines += [f"{k} = [{low:.6g}, {high:.6g}]" for k, (low, high) in ranges.items()]
    lines += [f"# {name}: {why}" for name, why in found.missing.items()]
    return "\n".join(lines) + "\n"


def read_delays(paths: Iterable[Path]) -> dict[str, Any]:
    """Read what ``calibrate delay --json`` and ``calibrate arm --json`` have printed.

    Returns:
        All of it in one: ``camera`` and ``arm`` are delays of the one, ``action_delay``
        and ``servo_time`` parameters of the other.

    Raises:
        ValueError: no such file, or something else.
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
                f"--delays {path}: not what calibrate delay or calibrate arm prints"
            )
        found |= given
    return found
