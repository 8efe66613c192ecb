"""Finder of the simulated backends, which are the folders next to this file."""

from __future__ import annotations

import importlib
import pkgutil
from typing import cast

from marl_airhockey.sim.contracts.backend import Backend


def simulated_names() -> list[str]:
    """Return the names of the simulated backends."""
    package = importlib.import_module(__package__)
    found = pkgutil.iter_modules(package.__path__)
    return sorted(m.name for m in found if m.ispkg and not m.name.startswith("_"))


def simulated_backend(name: str) -> type[Backend]:
    """Return the class of a simulated backend, even if it cannot run here."""
    return cast(type[Backend], importlib.import_module(f"{__package__}.{name}").make)
