"""Checks of the options that all scenarios share, and of all numeric options."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from marl_airhockey.sim.contracts.units import check_number
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.seat import SEAT_KINDS
from marl_airhockey.sim.core.table import TABLES, Table

CHOICES = {
    "seats": ("kind of seats", SEAT_KINDS),
    "table": ("table", TABLES),
    "goals": ("type of goals", ("flat", "dict")),
    "rules": ("rules", ("own", "paper")),
}
"""Description of an option, and its values."""
ELEMENTS = {"obstacles": (3, 5), "reward_regions": (4,), "drag_regions": (4,)}
"""Options that are lists of elements of the scene, and the allowed number of numbers in
an element."""


def checked_options(scenario: Any) -> dict[str, Any]:
    """Return the options of a scenario as plain numbers and tuples.

    Args:
        scenario: Scenario, a dataclass whose fields are its options.

    Raises:
        ValueError: An option has a value that is not allowed. The message names it.
    """
    for name, (what, known) in CHOICES.items():
        if getattr(scenario, name) not in known:
            raise ValueError(unknown_name(what, getattr(scenario, name), known))
    found = {f.name: getattr(scenario, f.name) for f in fields(scenario)}
    for name, sizes in ELEMENTS.items():
        found[name] = _elements(name, found[name], sizes)
    for f in fields(scenario):
        if isinstance(found[f.name], np.generic):
            found[f.name] = found[f.name].item()
        check_number(f.name, f.type, found[f.name])
    if found["seconds"] == 0:
        raise ValueError("seconds: must be above 0")
    return found


def _elements(name: str, value: Any, sizes: tuple[int, ...]) -> tuple[Any, ...]:
    """Return the elements of an option as tuples; raise ValueError for other values."""
    try:
        found = tuple(tuple(float(x) for x in element) for element in value)
    except (TypeError, ValueError):
        found = ((),)
    for k, element in enumerate(found):
        if len(element) not in sizes or not np.isfinite(element).all():
            words = " or ".join(map(str, sizes))
            raise ValueError(
                f"{name}: {value!r}; expected a list of lists of {words} numbers"
            )
        if element[2] <= 0:
            raise ValueError(f"{name}: element {k}, {element}: radius must be above 0")
        most = PARAMETERS["puck_damping"].high
        if name == "drag_regions" and not 0 <= element[3] <= most:
            raise ValueError(
                f"{name}: element {k}, {element}: drag must be in 0 .. {most:g} 1/s"
            )
    return found


def check_places(scenario: Any, table: Table) -> None:
    """Check that the elements of a scenario are on its table.

    Raises:
        ValueError: An element is not on the table. The message names it.
    """
    half = np.abs(table.vertices).max(0)
    elements = [(n, k, e) for n in ELEMENTS for k, e in enumerate(getattr(scenario, n))]
    for name, k, element in elements:
        x, y, radius = element[:3]
        ends = np.array([[x, y], element[3:5] if len(element) == 5 else [x, y]])
        # A bar may lie across the table with both ends outside.
        nearest = np.maximum(ends.min(0), np.minimum(ends.max(0), 0.0))
        if (np.abs(nearest) - radius > half).any() or radius > 2 * half.max():
            raise ValueError(
                f"{name}: element {k}, {element}, is not on the table, which reaches "
                f"from -{half[0]:g} to {half[0]:g} m and from -{half[1]:g} to "
                f"{half[1]:g} m"
            )
