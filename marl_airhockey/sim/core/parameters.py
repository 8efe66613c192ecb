"""Physical parameters: their defaults, bounds and presets."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

from marl_airhockey.sim.core.errors import unknown_name


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
    "slope": Parameter(0.0, 0.0, 5.0, "deg", "sd of a slope besides, in any direction"),
    "wall_restitution_scatter": Parameter(
        0.0, 0.0, 0.3, "1", "sd at walls, from bounce to bounce"
    ),
    "wall_exit_scatter": Parameter(
        0.0, 0.0, 0.5, "m/s", "sd of the speed along a wall after a bounce"
    ),
    "paddle_restitution_scatter": Parameter(
        0.0, 0.0, 0.3, "1", "sd at paddles, from hit to hit"
    ),
    "spin_scatter": Parameter(
        0.0, 0.0, 1.0, "1", "sd of the edge's speed after a hit, per speed of the puck"
    ),
    "action_delay": Parameter(0.0, 0.0, 0.25, "s", "from asking to acting"),
    "servo_time": Parameter(
        0.0, 0.0, 0.5, "s", "in which a paddle makes half of a change of velocity"
    ),
    "observation_delay": Parameter(0.0, 0.0, 0.25, "s", "age of what is seen"),
    "observation_jitter": Parameter(
        0.0, 0.0, 0.1, "s", "up to which more is drawn at every step"
    ),
    "position_noise": Parameter(0.0, 0.0, 0.05, "m", "standard deviation, per axis"),
    "calibration_error": Parameter(
        0.0, 0.0, 0.05, "m", "sd of a smooth shift of what is seen, per axis"
    ),
    "occlusion": Parameter(
        0.0, 0.0, 0.9, "1", "share of time a puck near an arm is unseen"
    ),
    "false_detection": Parameter(
        0.0, 0.0, 0.5, "1", "share of frames in which a puck is seen elsewhere"
    ),
    "arm_stiffness": Parameter(400.0, 25.0, 1600.0, "1/s2", "of following", arms=True),
    "arm_force": Parameter(40.0, 5.0, 80.0, "N", "of a paddle on the table", arms=True),
    "arm_payload": Parameter(0.0, 0.0, 1.0, "kg", "unknown to the arm", arms=True),
}
"""Physical parameters by name."""


def parameter_range(name: str, value: Any, where: str) -> tuple[float, float]:
    """Return the range of a parameter that a user gives as a number or as its ends.

    Args:
        name: name of the parameter.
        value: a number, or (low, high).
        where: place of the value, for messages.

    Raises:
        ValueError: an unknown name, no numbers, or numbers outside the bounds.
    """
    if name not in PARAMETERS:
        raise ValueError(unknown_name("physical parameter", name, PARAMETERS))
    parameter = PARAMETERS[name]
    pair = value if isinstance(value, (tuple, list)) else (value, value)
    numbers = [v for v in pair if isinstance(v, Real) and not isinstance(v, bool)]
    if len(pair) != 2 or len(numbers) != 2:
        raise ValueError(f"{where}: expected a number or (low, high), got {value!r}")
    low, high = map(float, numbers)
    if not parameter.low <= low <= high <= parameter.high:
        raise ValueError(
            f"{where}: {value!r} must lie within {parameter.low} .. "
            f"{parameter.high} {parameter.unit}".rstrip(" 1")
            + (", the lower end first" if low != high else "")
        )
    return low, high


LAWS = (
    *("puck_drag", "puck_damping", "wall_restitution", "wall_restitution_slope"),
    *("wall_friction", "paddle_restitution", "paddle_friction"),
    *("puck_restitution", "puck_friction", "block_restitution"),
)
"""Names of the parameters of the laws of pucks."""
SCATTER = (
    *("wall_restitution_scatter", "wall_exit_scatter"),
    *("paddle_restitution_scatter", "spin_scatter"),
)
"""Names of the parameters by which single contacts lie off the laws."""


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


PUCK_SPEED_CAP = 12.0
"""Highest speed of a puck (m/s); fewer than one in 200 shots of people are faster."""


SLOWEST_BOUNCE = 0.4
"""Normal speed (m/s) below which restitution at walls is that of this speed: slower
bounces were not measured, and the law would pass 1 there."""
