"""Settings that every run has, whatever it learns from, and their form as TOML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, ClassVar

from marl_airhockey.policies.policy import trained_in
from marl_airhockey.policies.runs import RUN_FORMAT
from marl_airhockey.registry import DEFAULT_BACKEND
from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.sim.world.keywords import Keywords


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Settings of a run.

    Raises:
        ValueError: a value that makes no sense, named.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = ("seed",)
    """Numbers that need not be above 0"""

    scenario: str
    seed: int = 0
    backend: str = DEFAULT_BACKEND
    profile: str = "ideal"
    observe: str = "velocity"
    options: dict[str, Any] = field(default_factory=dict)
    """Values of the scenario's own fields, by name"""
    drivers: dict[str, str] = field(default_factory=dict)
    """Drivers of seats that are not learned, by agent"""
    physics: dict[str, Any] = field(default_factory=dict)
    """Physical parameters, by name: numbers or ranges"""
    control_dt: float = 0.05
    """s between two actions; `gamma` is of one of them"""
    total_steps: int
    batch_size: int
    learning_rate: float
    gamma: float
    hidden: list[int]
    """Widths of the hidden layers; networks share none"""
    evaluations: int
    """Number of evaluations during training"""
    eval_episodes: int
    torch_threads: int = 1

    def __post_init__(self) -> None:
        check_fields(self)
        for f in fields(self):
            value = getattr(self, f.name)
            positive = f.name not in self.MAY_BE_ZERO
            if f.type in ("int", "float") and positive and value <= 0:
                raise ValueError(f"{f.name}: {value} must be above 0")
        if self.seed < 0:
            raise ValueError(f"seed: {self.seed} must be 0 or more")
        if not self.hidden or any(w < 1 for w in self.hidden):
            raise ValueError(f"hidden: {self.hidden} must be widths above 0")
        if self.gamma > 1.0:
            raise ValueError(f"gamma: {self.gamma} must be in 0 .. 1")

    @property
    def keywords(self) -> Keywords:
        """Keywords of the environments of evaluations."""
        return {
            "backend": self.backend,
            "profile": self.profile,
            "observe": self.observe,
            "options": self.options,
            "drivers": self.drivers,
            "physics": self.physics,
            "control_dt": self.control_dt,
        }

    def card(self, labels: Sequence[str]) -> dict[str, Any]:
        """Return the card of a policy of this run: the environment that it needs.

        Args:
            labels: Names of the elements of its observations.
        """
        return {
            "run_format": RUN_FORMAT,
            **trained_in(vars(self)),
            "observe": self.observe,
            "labels": list(labels),
        }

    def to_toml(self) -> str:
        """Return the configuration as TOML, readable by `settings.load_config`."""
        lines, tables = [f"format = {RUN_FORMAT}"], []
        for name, value in asdict(self).items():
            if isinstance(value, dict):
                tables.append(f"\n[{name}]")
                tables += [f"{k} = {_toml(v)}" for k, v in value.items()]
            else:
                lines.append(f"{name} = {_toml(value)}")
        return "\n".join([*lines, *tables]) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value)
