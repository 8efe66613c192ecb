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

Given = str | Path | Mapping[str, Any]
"""Physics as users give it: the name of a preset, a TOML file, or values and ranges by
name, which change those of a ``preset`` if one is named among them."""


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
    "tilt": Parameter(5.5, -45.0, 45.0, "deg", "slope toward home"),
    "cross_tilt": Parameter(0.0, -45.0, 45.0, "deg", "slope toward the right"),
    "puck_drag": Parameter(0.02, 0.0, 1.0, "1/m", "quadratic drag of a puck"),
    "puck_damping": Parameter(0.0, 0.0, 10.0, "1/s", "linear drag of a puck"),
    "wall_restitution": Parameter(0.85, 0.0, 1.0, "1", "at walls, at 1 m/s"),
    "wall_restitution_slope": Parameter(
        0.02, -0.2, 0.2, "1", "its loss per ln(m/s) of normal speed"
    ),
    "wall_friction": Parameter(0.12, 0.0, 2.0, "1", "Coulomb, puck at walls"),
    "paddle_restitution": Parameter(0.5, 0.0, 1.0, "1", "puck at a paddle"),
    "paddle_friction": Parameter(0.1, 0.0, 2.0, "1", "Coulomb, puck at a paddle"),
    "puck_restitution": Parameter(0.9, 0.0, 1.0, "1", "puck at a puck"),
    "puck_friction": Parameter(0.1, 0.0, 2.0, "1", "Coulomb, puck at puck or block"),
    "block_restitution": Parameter(0.7, 0.0, 1.0, "1", "of blocks"),
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
"""Physical parameters by name."""


LAWS = (
    *("puck_drag", "puck_damping", "wall_restitution", "wall_restitution_slope"),
    *("wall_friction", "paddle_restitution", "paddle_friction"),
    *("puck_restitution", "puck_friction", "block_restitution"),
)
"""Names of the parameters of the laws of pucks."""


PRESETS: dict[str, dict[str, float]] = {
    "professional": {name: PARAMETERS[name].default for name in LAWS},
    "wooden": {
        "puck_drag": 0.027,
        "puck_damping": 0.0,
        "wall_restitution": 0.67,
        "wall_restitution_slope": 0.07,
        "wall_friction": 0.29,
        "paddle_restitution": 0.62,
        "paddle_friction": 0.1,
        "puck_restitution": 0.9,
        "puck_friction": 0.1,
        "block_restitution": 0.7,
    },
    "authors": {"tilt": 4.016, "puck_drag": 0.0, "puck_damping": 0.346},
    "frictionless": {
        "puck_drag": 0.0,
        "puck_damping": 0.0,
        "wall_restitution": 0.9,
        "wall_restitution_slope": 0.0,
        "wall_friction": 0.0,
        "paddle_restitution": 0.85,
        "paddle_friction": 0.0,
        "puck_restitution": 1.0,
        "puck_friction": 0.0,
        "block_restitution": 0.9,
    },
}
"""Presets by name.

``professional``, the default, and ``wooden`` are round numbers of two real tables
measured in play; friction at paddles, between pucks and the restitutions of pucks and
blocks could not be measured there and are guesses. ``authors`` is what the paper's
authors identified on their table, a pull of 0.687 m/s2 and a linear drag.
``frictionless`` has closed forms: no drag, no friction, restitutions that do not depend
on speed."""


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


PUCK_SPEED_CAP = 12.0
"""Highest speed of a puck (m/s); fewer than one in 200 shots of people are faster."""


SLOWEST_BOUNCE = 0.4
"""Normal speed (m/s) below which restitution at walls is that of this speed: slower
bounces were not measured, and the law would pass 1 there."""


class Physics:
    """Parameters of an environment: a value or a range for each name.

    Args:
        base: values that replace the defaults (table, seats, scenario).
        profile: "ideal", or "robot" for delays, noise and a spread of +-15 %.
        given: the user's physics. A preset overrides ``base``; values and ranges
            override the profile, too.
        arms: True if the backend has robot arms, whose parameters exist then.

    Raises:
        ValueError: an unknown name, or a value outside its bounds.
    """

    def __init__(
        self,
        base: Mapping[str, float],
        profile: str = "ideal",
        given: Given | None = None,
        arms: bool = False,
    ) -> None:
        if profile not in PROFILES:
            raise ValueError(unknown_name("profile", profile, PROFILES))
        chosen = load_physics(given) if isinstance(given, (str, Path)) else given or {}
        values = dict(chosen)
        base = {**base, **_preset(values.pop("preset", None))}
        self.ranges: dict[str, tuple[float, float]] = {}
        for name, parameter in PARAMETERS.items():
            if parameter.arms and not arms:
                continue
            value = base.get(name, parameter.default)
            spread = 0.0
            if profile == "robot":
                value = ROBOT_SENSING.get(name, value)
                spread = ROBOT_SPREAD * abs(value)
            high = min(value + spread, parameter.high)
            self.ranges[name] = (value - spread, high)
        for name, value in values.items():
            pair = _checked(name, value)
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
        return tomllib.loads(Path(source).read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        names = ", ".join(PRESETS)
        raise ValueError(
            f"physics {str(source)!r}: no preset ({names}) and no TOML file of "
            f"parameters: {error}"
        ) from error
