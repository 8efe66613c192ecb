"""Physical parameters with their defaults, bounds and presets."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

from marl_airhockey.sim.core.errors import unknown_name


@dataclass(frozen=True)
class Parameter:
    """Physical parameter with a default and bounds.

    Values outside the bounds raise ValueError.
    """

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
    "wall_restitution": Parameter(0.85, 0.0, 1.0, "1", "restitution at walls at 1 m/s"),
    "wall_restitution_slope": Parameter(
        0.02, -0.2, 0.2, "1", "loss of wall restitution per ln(m/s) of normal speed"
    ),
    "wall_friction": Parameter(0.12, 0.0, 2.0, "1", "Coulomb friction at walls"),
    "paddle_restitution": Parameter(0.5, 0.0, 1.0, "1", "restitution at paddles"),
    "paddle_friction": Parameter(0.1, 0.0, 2.0, "1", "Coulomb friction at paddles"),
    "puck_restitution": Parameter(0.9, 0.0, 1.0, "1", "restitution between pucks"),
    "puck_friction": Parameter(
        0.1, 0.0, 2.0, "1", "Coulomb friction of a puck at pucks and blocks"
    ),
    "block_restitution": Parameter(0.7, 0.0, 1.0, "1", "restitution of blocks"),
    "puck_mass": Parameter(0.03, 0.001, 1.0, "kg", "mass of a puck"),
    "block_mass": Parameter(0.06, 0.001, 5.0, "kg", "mass of a block"),
    "block_friction": Parameter(2.4, 0.0, 20.0, "m/s2", "Coulomb friction of blocks"),
    "paddle_speed": Parameter(0.7, 0.05, 10.0, "m/s", "top speed of a paddle"),
    "paddle_acceleration": Parameter(
        7.0, 0.1, 200.0, "m/s2", "largest acceleration of a paddle"
    ),
    "slope": Parameter(
        0.0, 0.0, 5.0, "deg", "sd of an additional slope in any direction"
    ),
    "wall_restitution_scatter": Parameter(
        0.0, 0.0, 0.3, "1", "sd of the wall restitution of single bounces"
    ),
    "wall_exit_scatter": Parameter(
        0.0, 0.0, 0.5, "m/s", "sd of the speed along a wall after a bounce"
    ),
    "paddle_restitution_scatter": Parameter(
        0.0, 0.0, 0.3, "1", "sd of the paddle restitution of single hits"
    ),
    "spin_scatter": Parameter(
        0.0, 0.0, 1.0, "1", "sd of the edge's speed after a hit, per speed of the puck"
    ),
    "action_delay": Parameter(0.0, 0.0, 0.25, "s", "action latency"),
    "servo_time": Parameter(
        0.0, 0.0, 0.5, "s", "time of a paddle to 50 % of a velocity step"
    ),
    "observation_delay": Parameter(0.0, 0.0, 0.25, "s", "observation latency"),
    "observation_jitter": Parameter(
        0.0, 0.0, 0.1, "s", "largest additional latency, sampled in every step"
    ),
    "position_noise": Parameter(
        0.0, 0.0, 0.05, "m", "sd of the noise of sensed positions, per axis"
    ),
    "calibration_error": Parameter(
        0.0, 0.0, 0.05, "m", "sd of a smooth error of sensed positions, per axis"
    ),
    "occlusion": Parameter(
        0.0, 0.0, 0.9, "1", "share of time in which a puck near an arm is hidden"
    ),
    "false_detection": Parameter(
        0.0, 0.0, 0.5, "1", "share of frames in which a puck is detected elsewhere"
    ),
    "angle_noise": Parameter(
        0.0, 0.0, 1.0, "rad", "sd of the sensed orientation; 0 for pucks without a mark"
    ),
    "angle_dropout": Parameter(
        0.0, 0.0, 0.9, "1", "share of frames in which the mark of a puck is not read"
    ),
    "arm_stiffness": Parameter(
        400.0, 25.0, 1600.0, "1/s2", "stiffness of the position control", arms=True
    ),
    "arm_force": Parameter(
        40.0, 5.0, 80.0, "N", "force of a paddle on the table", arms=True
    ),
    "arm_payload": Parameter(
        0.0, 0.0, 1.0, "kg", "payload unknown to the arm's controller", arms=True
    ),
}
"""Physical parameters by name."""


def parameter_range(name: str, value: Any, where: str) -> tuple[float, float]:
    """Return the range of a parameter that is given as a number or as (low, high).

    Args:
        name: Name of the parameter.
        value: Number, or (low, high).
        where: Location of the value, for messages.

    Raises:
        ValueError: The name is unknown, a value is not a number, or it is outside the
            bounds.
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
"""Names of the parameters of drag and contacts of pucks and blocks."""
SCATTER = (
    *("wall_restitution_scatter", "wall_exit_scatter"),
    *("paddle_restitution_scatter", "spin_scatter"),
)
"""Names of the parameters of contact noise."""


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

``professional``, the default, and ``wooden`` are rounded values of two real tables that
were measured in play. Friction at paddles and between pucks, and the restitution of
pucks and blocks could not be measured there. These values are guesses. ``authors`` is
what the paper's authors identified on their table: an acceleration of 0.687 m/s2 by the
tilt, and a linear drag. ``frictionless`` has closed-form solutions: no drag, no
friction, and restitutions that do not depend on speed."""


PUCK_SPEED_CAP = 12.0
"""Highest speed of a puck (m/s). Fewer than one in 200 shots of people are faster."""


SLOWEST_BOUNCE = 0.4
"""Normal speed (m/s) below which the restitution at walls is constant. Slower bounces
were not measured, and the formula would exceed 1 there."""
