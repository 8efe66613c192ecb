"""Configuration of soft actor-critic with hindsight goals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.learn.settings import check_names
from marl_airhockey.registry import has_goals, scenario_names
from marl_airhockey.sim.core.errors import unknown_name

ALGO = "sac_her"
"""Name of the algorithm."""
CHOICES = {"ends": ("relabelled", "recorded"), "critics": ("mean", "quantiles")}
"""Possible values of settings, by name."""


@dataclass(frozen=True, kw_only=True)
class HindsightConfig(RunConfig):
    """Settings of a run of ``--algo sac_her``.

    Raises:
        ValueError: A setting is invalid. The message names it.
    """

    algo: str = ALGO
    """Name of the algorithm, "sac_her"."""
    total_steps: int = 500_000
    """Number of steps, summed over all worlds, above the steps of random actions."""
    num_worlds: int = 32
    """Number of parallel worlds, above 0."""
    gradient_steps: int = 16
    """Number of gradient steps after each step of all worlds, above 0."""
    batch_size: int = 256
    """Number of steps in a minibatch, above 0."""
    learning_rate: float = 1e-3
    """Learning rate, above 0."""
    gamma: float = 0.95
    """Discount per control step, above 0 and at most 1."""
    tau: float = 0.02
    """Share by which the target critics move toward the critics in a gradient step,
    above 0."""
    relabelled: int = 4
    """Number of copies of each step with a goal that its episode reached later, above
    0."""
    critics: str = "mean"
    """Output of the critics: "mean" for the mean return, as in SAC, or "quantiles", as
    in TQC of sb3-contrib."""
    ends: str = "relabelled"
    """Terminations of relabelled steps: "relabelled", where the new goal is met, or
    "recorded", those of the former goal, as in stable-baselines3."""
    memory_steps: int = 500_000
    """Size of the replay buffer, steps, above 0."""
    learning_starts: int = 8_000
    """Number of steps with random actions at the beginning, summed over all worlds,
    above 0. It is increased to the length of an episode in all worlds if it is
    smaller."""
    hidden: list[int]
    """Widths of the hidden layers, each above 0."""
    evaluations: int = 10
    """Number of evaluations during training, above 0."""
    eval_episodes: int = 200
    """Number of episodes of each evaluation, above 0."""

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
                f"{self.scenario} has no goals, but {ALGO} needs goals; scenarios with "
                f"goals: {known}"
            )


def hindsight_config(scenario: str, changes: Mapping[str, Any]) -> HindsightConfig:
    """Return the configuration of a run.

    Args:
        scenario: Name of a scenario with goals.
        changes: Changed settings, by name.

    Raises:
        ValueError: The scenario has no goals, or a setting is invalid.
    """
    check_names(HindsightConfig, changes)
    options = {**changes.get("options", {}), "goals": "dict"}
    merged = {"hidden": [256, 256], **changes, "options": options}
    return HindsightConfig(**{**merged, "scenario": scenario})
