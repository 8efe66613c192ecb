"""Emulated devices of a table, whose faults pages can switch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Plant:
    """Emulated devices of a table, whose faults can be switched on and off."""

    faults: Mapping[str, str] = field(default_factory=dict)
    """Descriptions of the faults, by name."""
    switch: Callable[[str, bool], None] = lambda name, on: None
    """Function that switches a fault on or off."""
    active: Callable[[], Sequence[str]] = tuple
    """Function that returns the names of the faults that are on."""
