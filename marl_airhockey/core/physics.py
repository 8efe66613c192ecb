"""Physical parameters: defaults, bounds, profiles and random draws per episode.

A parameter is a number, or a range ``(low, high)`` drawn for every episode.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.core.errors import unknown_name
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.types import Array

Value = float | tuple[float, float]
"""Fixed value of a parameter, or its range ``(low, high)``."""


@dataclass(frozen=True)
class Parameter:
    """Physical parameter, with the bounds outside which a value is refused."""

    default: float
    low: float
    high: float
    unit: str
    meaning: str
    arms: bool = False
    """True for parameters that exist only on backends with robot arms."""


PARAMETERS: dict[str, Parameter] = {
    "tilt": Parameter(5.5, 0.0, 45.0, "deg", "slope toward home"),
    "wall_restitution": Parameter(0.9, 0.0, 1.0, "1", "puck against wall"),
    "paddle_restitution": Parameter(0.85, 0.0, 1.0, "1", "puck against paddle"),
    "block_restitution": Parameter(0.9, 0.0, 1.0, "1", "puck against block"),
    "puck_damping": Parameter(0.15, 0.0, 10.0, "1/s", "drag of what slides"),
    "puck_mass": Parameter(0.03, 0.001, 1.0, "kg", "mass of a puck"),
    "block_mass": Parameter(0.06, 0.001, 5.0, "kg", "mass of a block"),
    "block_friction": Parameter(2.4, 0.0, 20.0, "m/s2", "Coulomb friction of blocks"),
    "paddle_speed": Parameter(0.7, 0.05, 10.0, "m/s", "top speed of a paddle"),
    "paddle_acceleration": Parameter(7.0, 0.1, 200.0, "m/s2", "largest acceleration"),
    "action_delay": Parameter(0.0, 0.0, 0.25, "s", "from asking to acting"),
    "observation_delay": Parameter(0.0, 0.0, 0.25, "s", "age of what is seen"),
    "position_noise": Parameter(0.0, 0.0, 0.05, "m", "standard deviation, per axis"),
    "occlusion": Parameter(0.0, 0.0, 0.5, "1", "share of time a puck is unseen"),
    "arm_stiffness": Parameter(400.0, 25.0, 1600.0, "1/s2", "of following", arms=True),
    "arm_force": Parameter(40.0, 5.0, 80.0, "N", "of a paddle on the table", arms=True),
    "arm_payload": Parameter(0.0, 0.0, 1.0, "kg", "unknown to the arm", arms=True),
}
"""Physical parameters by name. A pair's restitution is the lower of its bodies'; that
of a puck is 1."""


ROBOT_SENSING: dict[str, float] = {
    "action_delay": 0.050,
    "observation_delay": 0.033,
    "position_noise": 0.002,
    "occlusion": 0.05,
}
"""Delays and noise of the robot profile, measured on cameras and arms of this class."""


ROBOT_SPREAD = 0.15
"""Half-width of the range of every parameter in the robot profile, per value."""


PROFILES: tuple[str, ...] = ("ideal", "robot")
"""Names of the profiles."""


PUCK_SPEED_CAP = 5.0
"""Highest speed of a puck (m/s), which bounds what a squeezed one can gain."""


class Physics:
    """Parameters of an environment: a value or a range for each name.

    Args:
        base: values that replace the defaults (table, seats, scenario).
        profile: "ideal", or "robot" for delays, noise and a spread of +-15 %.
        given: the user's values and ranges; they override ``base`` and profile.
        arms: True if the backend has robot arms, whose parameters exist then.

    Raises:
        ValueError: an unknown name, or a value outside its bounds.
    """

    def __init__(
        self,
        base: Mapping[str, float],
        profile: str = "ideal",
        given: Mapping[str, Value] | None = None,
        arms: bool = False,
    ) -> None:
        if profile not in PROFILES:
            raise ValueError(unknown_name("profile", profile, PROFILES))
        self.ranges: dict[str, tuple[float, float]] = {}
        for name, parameter in PARAMETERS.items():
            if parameter.arms and not arms:
                continue
            value = base.get(name, parameter.default)
            spread = 0.0
            if profile == "robot":
                value = ROBOT_SENSING.get(name, value)
                spread = ROBOT_SPREAD * value
            high = min(value + spread, parameter.high)
            self.ranges[name] = (value - spread, high)
        for name, chosen in (given or {}).items():
            pair = _checked(name, chosen)
            if name not in self.ranges:
                raise ValueError(
                    f"physics[{name!r}] is of arms, and this backend has none: "
                    "leave it out, or take backend='robosuite'"
                )
            self.ranges[name] = pair

    def draw(self, rng: RandomStreams) -> dict[str, Array]:
        """Draw one value of every parameter for each of W worlds: name -> (W,)."""
        values = {}
        for name, (low, high) in self.ranges.items():
            if low == high:
                values[name] = np.full(len(rng), low)
            else:
                values[name] = rng.uniform(low, high)
        return values

    def highest(self, name: str) -> float:
        """Return the largest value that a parameter can take here."""
        return self.ranges[name][1]

    @property
    def varies(self) -> bool:
        """True if any parameter is drawn per episode."""
        return any(low != high for low, high in self.ranges.values())


def _checked(name: str, value: Value) -> tuple[float, float]:
    if name not in PARAMETERS:
        raise ValueError(unknown_name("physical parameter", name, PARAMETERS))
    parameter = PARAMETERS[name]
    pair = value if isinstance(value, (tuple, list)) else (value, value)
    try:
        low, high = (float(v) for v in pair)
    except (TypeError, ValueError):
        raise ValueError(
            f"physics[{name!r}]: expected a number or (low, high), got {value!r}"
        ) from None
    if not parameter.low <= low <= high <= parameter.high:
        raise ValueError(
            f"physics[{name!r}]: {value!r} {parameter.unit} is outside "
            f"{parameter.low} .. {parameter.high} or its ends are swapped"
        )
    return low, high


def load_physics(path: Path) -> dict[str, Any]:
    """Read a preset for ``physics=``: parameters by name, numbers or pairs, in TOML.

    Raises:
        ValueError: no such file.
    """
    try:
        return tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path}: no preset of physics: {error}") from error
