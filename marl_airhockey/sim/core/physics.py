"""Physics of a world: values and ranges, and their random draws per episode.

A parameter is a number, or a range ``(low, high)`` drawn for every episode.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.parameters import (
    PARAMETERS,
    PRESETS,
    SCATTER,
    parameter_range,
)
from marl_airhockey.sim.core.profiles import CorrelatedParameter, find_profile
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.types import Array

Given = str | Path | Mapping[str, Any]
"""Physics as users give it: the name of a preset, a TOML file, or values and ranges by
name, which change those of a ``preset`` if one is named among them."""


SIMULATED = (
    *("observation_delay", "observation_jitter", "position_noise"),
    *("calibration_error", "occlusion", "false_detection"),
    *("action_delay", "servo_time", *SCATTER),
)
"""Names of what a simulation adds, since a real table has it by itself"""


class Physics:
    """Parameters of an environment: a value or a range for each name.

    Args:
        base: values that replace the defaults (table, seats, scenario).
        profile: name or file of the ranges that replace these, see
            `profiles.find_profile`.
        given: the user's physics: a preset, values and ranges, which override both.
        arms: True if the backend has robot arms, whose parameters exist then.
        real: True if the table is real: nothing that a simulation adds to a state is
            drawn, neither delays nor noise nor scatter.

    Raises:
        ValueError: an unknown name, or a value outside its bounds.
    """

    def __init__(
        self,
        base: Mapping[str, float],
        profile: str = "ideal",
        given: Given | None = None,
        arms: bool = False,
        real: bool = False,
    ) -> None:
        spread = find_profile(profile)
        chosen = load_physics(given) if isinstance(given, (str, Path)) else given or {}
        if not isinstance(chosen, Mapping):
            raise ValueError(
                f"physics: {given!r} is no preset, TOML file or dict of parameters"
            )
        values = dict(chosen)
        preset = _preset(values.pop("preset", None))
        self.ranges: dict[str, tuple[float, float]] = {}
        self._follows: dict[str, CorrelatedParameter] = {}
        for name, parameter in PARAMETERS.items():
            if parameter.arms and not arms:
                continue
            value = base.get(name, parameter.default)
            low, high = spread.shares.get(name, (1.0, 1.0))
            pair = min(low * value, high * value), max(low * value, high * value)
            pair = spread.ranges.get(name, pair)
            if name in preset:
                pair = preset[name], preset[name]
            elif name in spread.follows:
                self._follows[name] = spread.follows[name]
                pair = spread.follows[name].range
            self.ranges[name] = (
                max(pair[0], parameter.low),
                min(pair[1], parameter.high),
            )
        fixed = preset.keys() | values.keys()
        self._sloping = [n for n in ("tilt", "cross_tilt") if n not in fixed]
        """Tilts that a slope in any direction adds to: those that nobody has given"""
        for name, value in values.items():
            pair = parameter_range(name, value, f"physics[{name!r}]")
            if name not in self.ranges:
                raise ValueError(
                    f"physics[{name!r}] is of arms, and this backend has none: "
                    "leave it out, or take backend='robosuite'"
                )
            self.ranges[name] = pair
            self._follows.pop(name, None)
        if real:
            self.ranges.update(dict.fromkeys(SIMULATED, (0.0, 0.0)))

    def draw(self, rng: RandomStreams) -> dict[str, Array]:
        """Draw one value of every parameter for each of W worlds: name -> (W,)."""
        values: dict[str, Array] = {}
        drawn = [n for n, (a, b) in self.ranges.items() if n in self._follows or a != b]
        # All in one call, which for one world costs as much as a single one.
        units = dict(zip(drawn, rng.uniform(0.0, 1.0, len(drawn)).T, strict=True))
        for name, (low, high) in self.ranges.items():
            if name in self._follows:
                follow = self._follows[name]
                values[name] = follow.at_value(values[follow.other], units[name])
            elif name in units:
                values[name] = low + (high - low) * units[name]
            else:
                values[name] = np.full(len(rng), low)
        if self.highest("slope") > 0.0:
            for name in self._sloping:
                values[name] += values["slope"] * rng.normal()
        return values

    def highest(self, name: str) -> float:
        """Return the largest value that a parameter is drawn from here.

        The slope in any direction is added to the tilts besides.
        """
        return self.ranges[name][1]

    def any_of(self, *names: str) -> bool:
        """Return True if any of some parameters can be above 0."""
        return any(self.highest(name) > 0.0 for name in names)

    @property
    def varies(self) -> bool:
        """True if any parameter is drawn per episode."""
        ranges = self.ranges.values()
        return self.any_of("slope") or any(low != high for low, high in ranges)


def _preset(name: object) -> dict[str, float]:
    if name is None:
        return {}
    if not isinstance(name, str) or name not in PRESETS:
        raise ValueError(unknown_name("physics preset", name, PRESETS))
    return PRESETS[name]


def load_physics(source: str | Path) -> dict[str, Any]:
    """Return physics by the name of a preset, or from a TOML file of parameters.

    In a file a parameter is a number or a pair; ``preset`` may name what they change.

    Raises:
        ValueError: neither a preset nor a file that can be read.
    """
    if str(source) in PRESETS:
        return {"preset": str(source)}
    try:
        found = tomllib.loads(Path(source).read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        names = ", ".join(PRESETS)
        raise ValueError(
            f"physics {str(source)!r}: no preset ({names}) and no TOML file of "
            f"parameters: {error}"
        ) from error
    if not found:
        raise ValueError(f"physics {source}: there are no parameters in the file")
    return found
