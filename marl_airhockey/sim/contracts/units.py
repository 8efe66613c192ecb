"""Units of the numeric options of scenarios, with the largest value of each.

A field of a scenario is declared with one of them, for example
``radius: Metres = 0.04``. A plain ``float`` has no largest value.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from marl_airhockey.sim.core.parameters import PUCK_SPEED_CAP

Degrees = float
Latency = float
Metres = float
Pucks = int
Seconds = float
Share = float
Speed = float
Weight = float


class Unit(NamedTuple):
    """Unit of an option."""

    most: float
    """Largest value."""
    symbol: str = ""
    least: float = 0.0


UNITS = {
    "Degrees": Unit(180.0, "deg"),
    "Latency": Unit(1.0, "s"),
    "Metres": Unit(5.0, "m"),
    "Pucks": Unit(8.0, "", 1.0),
    "Seconds": Unit(3600.0, "s"),
    "Share": Unit(1.0),
    "Speed": Unit(PUCK_SPEED_CAP, "m/s"),
    "Weight": Unit(1000.0),
    "float": Unit(math.inf),
    "int": Unit(1000.0, "", 1.0),
}
"""Units by the name of the declared type of a field."""


def check_number(name: str, kind: object, value: object) -> None:
    """Check the value of a numeric option.

    Args:
        name: Name of the option.
        kind: Declared type of the option, as text. Only types in `UNITS` are checked.
        value: Value of the option.

    Raises:
        ValueError: The value is not a number, is a range, or is outside the bounds of
            its unit.
    """
    if kind not in UNITS:
        return
    if isinstance(value, (tuple, list)):
        raise ValueError(
            f"{name}: {value!r} is a range; rules and geometry are fixed when built, "
            "only physics can be sampled per episode"
        )
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name}: expected a number, got {value!r}")
    whole, unit = kind in ("int", "Pucks"), UNITS[str(kind)]
    fits = isinstance(value, int) or not whole
    if not (fits and math.isfinite(value) and unit.least <= value <= unit.most):
        words = "a whole number" if whole else "a number"
        raise ValueError(f"{name}: {value!r} must be {words} {range_of(str(kind))}")


def range_of(kind: str) -> str:
    """Return the allowed values of an option as text; "" if it is not a number."""
    if kind not in UNITS:
        return ""
    unit = UNITS[kind]
    if unit.most == math.inf:
        return f"of at least {unit.least:g}"
    return f"from {unit.least:g} to {unit.most:g} {unit.symbol}".rstrip()
