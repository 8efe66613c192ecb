"""Physics of a world: parameters that are fixed or sampled for each episode.

A parameter is a number, or a range ``(low, high)`` that is sampled for each episode.
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
"""Physics parameters from a user: the name of a preset, a TOML file, or values and
ranges by name. The key ``preset`` names the preset that they modify."""


SIMULATED = (
    *("observation_delay", "observation_jitter", "position_noise"),
    *("calibration_error", "occlusion", "false_detection"),
    *("angle_noise", "angle_dropout"),
    *("action_delay", "servo_time", *SCATTER),
)
"""Names of the parameters that only a simulation needs. A real table has these effects
anyway."""


class Physics:
    """Parameters of an environment: a value or a range for each name.

    Args:
        base: Values of table, seats and scenario, which replace the defaults.
        profile: Name or file of a profile, whose ranges replace these values, see
            `profiles.find_profile`.
        given: Preset, values and ranges from the user, which override both.
        arms: True to include the parameters of robot arms.
        real: True for a real table, which needs no simulated latency, noise or contact
            noise.

    Raises:
        ValueError: A name is unknown, or a value is outside its bounds.
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
                f"physics: {given!r}; expected a preset, a TOML file or a dict of "
                "parameters"
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
        """Tilts that the user has not set, to which a random slope is added."""
        for name, value in values.items():
            pair = parameter_range(name, value, f"physics[{name!r}]")
            if name not in self.ranges:
                raise ValueError(
                    f"physics[{name!r}] needs a robot arm, which this backend lacks: "
                    "omit it, or use backend='robosuite'"
                )
            self.ranges[name] = pair
            self._follows.pop(name, None)
        if real:
            self.ranges.update(dict.fromkeys(SIMULATED, (0.0, 0.0)))

    def draw(self, rng: RandomStreams) -> dict[str, Array]:
        """Sample every parameter for each of W worlds; return arrays (W,) by name."""
        values: dict[str, Array] = {}
        drawn = [n for n, (a, b) in self.ranges.items() if n in self._follows or a != b]
        # One call samples all parameters. For one world it costs as much as one value.
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
        """Return the upper end of the range of a parameter.

        For the tilts, it does not include the random slope.
        """
        return self.ranges[name][1]

    def any_of(self, *names: str) -> bool:
        """Return True if any of some parameters can be above 0."""
        return any(self.highest(name) > 0.0 for name in names)

    @property
    def varies(self) -> bool:
        """True if any parameter is sampled for each episode."""
        ranges = self.ranges.values()
        return self.any_of("slope") or any(low != high for low, high in ranges)


def _preset(name: object) -> dict[str, float]:
    if name is None:
        return {}
    if not isinstance(name, str) or name not in PRESETS:
        raise ValueError(unknown_name("physics preset", name, PRESETS))
    return PRESETS[name]


def load_physics(source: str | Path) -> dict[str, Any]:
    """Return the physics of a preset, or of a TOML file of parameters.

    In a file a parameter is a number or a pair (low, high). The key ``preset`` names
    the preset that they modify.

    Raises:
        ValueError: The source is neither a preset nor a readable file.
    """
    if str(source) in PRESETS:
        return {"preset": str(source)}
    try:
        found = tomllib.loads(Path(source).read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        names = ", ".join(PRESETS)
        raise ValueError(
            f"physics {str(source)!r} is no preset ({names}) and no TOML file of "
            f"parameters: {error}"
        ) from error
    if not found:
        raise ValueError(f"physics {source}: the file contains no parameters")
    return found
