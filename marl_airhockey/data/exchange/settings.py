"""Settings of an import, for values that a dataset does not contain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class ImportSettings:
    """Settings of an import."""

    source: str
    """Name of the dataset, or path of its files."""
    scenario: str
    """Scenario to which the data belong."""
    out: Path
    """Folder of the new recording."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the scenario that the dataset does not contain."""
    control_dt: float = 0.05
    """Time of a step, s, if the dataset does not contain it."""
    root: Path | None = None
    """Folder of all Minari datasets; None for Minari's own folder."""

    def head(self, kind: str, known: Mapping[str, Any]) -> dict[str, Any]:
        """Return the metadata of the new recording.

        Args:
            kind: Name of the format.
            known: Values in the dataset of options, profile, observe, control_dt and
                goals.
        """
        goals = {"goals": known["goals"]} if known.get("goals") else {}
        return {
            "scenario": self.scenario,
            "options": {**self.options, **known.get("options", {})},
            "profile": known.get("profile", "ideal"),
            "observe": known.get("observe", "velocity"),
            "control_dt": known.get("control_dt", self.control_dt),
            **goals,
            "backend": known.get("backend", kind),
            "players": [{"driver": f"{kind}/{self.source}", "person": None}],
        }
