"""Configurations of soft actor-critic with hindsight goals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.learn.settings import check_names
from marl_airhockey.registry import has_goals, scenario_names
from marl_airhockey.sim.core.errors import unknown_name

ALGO = "sac_her"
"""Name of the algorithm"""
CHOICES = {"ends": ("relabelled", "recorded"), "critics": ("mean", "quantiles")}
"""Values of settings, by name"""


@dataclass(frozen=True, kw_only=True)
class HindsightConfig(RunConfig):
    """Settings of a run; ``total_steps`` are of single worlds, summed over all.

    Raises:
        ValueError: a value that makes no sense, named.
    """

    algo: str = ALGO
    total_steps: int = 500_000
    num_worlds: int = 32
    gradient_steps: int = 16
    """After each step of all worlds"""
    batch_size: int = 256
    learning_rate: float = 1e-3
    gamma: float = 0.95
    tau: float = 0.02
    """Share by which the target critics follow in a gradient step"""
    relabelled: int = 4
    """Steps with a goal that was met later, for each with its own"""
    critics: str = "mean"
    """What the critics learn: the "mean" of the return, as SAC; or its "quantiles", as
    TQC of sb3-contrib"""
    ends: str = "relabelled"
    """Terminations of steps with a goal that was met later: "relabelled", where the new
    goal is met; or "recorded", those of the former goal, as stable-baselines3 has it"""
    memory_steps: int = 500_000
    """Steps that are kept to learn from"""
    learning_starts: int = 8_000
    """Steps of random actions, with which it begins; all of an episode at least"""
    hidden: list[int]
    evaluations: int = 10
    eval_episodes: int = 200

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.algo != ALGO:
            raise ValueError(unknown_name("algo", self.algo, [ALGO]))
        for name, choices in CHOICES.items():
            value = getattr(self, name)
            if value not in choices:
                raise ValueError(unknown_name(name, value, choices))
        if not has_goals(self.scenario):
            known = ", ".join(name for name in scenario_names() if has_goals(name))
            raise ValueError(
                f"{self.scenario}: it has no goals, as {ALGO} needs; {known} have"
            )


def hindsight_config(scenario: str, changes: Mapping[str, Any]) -> HindsightConfig:
    """Return the configuration of a run.

    Args:
        scenario: its name.
        changes: settings by name.

    Raises:
        ValueError: a scenario without goals, or a bad setting.
    """
    check_names(HindsightConfig, changes)
    options = {**changes.get("options", {}), "goals": "dict"}
    merged = {"hidden": [256, 256], **changes, "options": options}
    return HindsightConfig(**{**merged, "scenario": scenario})
