"""Names of scenarios and drivers, read from their folders without imports.

``import marl_airhockey`` registers every scenario with gymnasium, with its version in
the id. To import all scenarios for this would load most of the package.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from importlib.util import find_spec

VERSION = re.compile(r"^    version: ClassVar\[int\] = (\d+)$", re.MULTILINE)
"""Line of a scenario's file that sets its version, which is 0 otherwise."""


def names_in(folder: str) -> list[str]:
    """Return the names of the files in ``scenarios/`` or ``drivers/``."""
    package = importlib.import_module(f"marl_airhockey.{folder}")
    found = pkgutil.iter_modules(package.__path__)
    return sorted(m.name for m in found if not m.name.startswith("_"))


def version_of(scenario: str) -> int:
    """Return the version of a scenario of this library."""
    spec = find_spec(f"marl_airhockey.scenarios.{scenario}")
    assert spec is not None
    assert spec.origin is not None
    with open(spec.origin, encoding="utf-8") as file:
        found = VERSION.search(file.read())
    return int(found[1]) if found else 0


def gymnasium_id(scenario: str) -> str:
    """Return the gymnasium id, with its version, of a scenario of this library."""
    camel = "".join(word.capitalize() for word in scenario.split("_"))
    return f"marl_airhockey/{camel}-v{version_of(scenario)}"


def pettingzoo_id(scenario: str) -> str:
    """Return the PettingZoo id, with its version, of a scenario of this library."""
    return f"marl_airhockey/{scenario}-v{version_of(scenario)}"
