"""Sim-to-sim transfer: success of policies with physics they were not trained with."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from marl_airhockey.evaluation.evaluate import EvaluationResult, evaluate
from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.settings import load_config
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.keywords import Keywords

TUNING: dict[str, Any] = {
    "backend": "robosuite",
    "num_worlds": 32,
    "n_steps": 64,
    "batch_size": 512,
    "learning_rate": 5e-5,
    "max_learning_rate": 1e-4,
    "evaluations": 5,
    "eval_episodes": 50,
}
"""Settings that replace a run's when its policy is trained further on robosuite."""


def measure_transfer(
    policies: dict[str, Driver],
    scenario: str,
    backends: Sequence[str],
    profiles: Sequence[str],
    episodes: int = 200,
    keywords: Keywords | None = None,
    report: Callable[[], None] = lambda: None,
) -> list[EvaluationResult]:
    """Evaluate policies in all backends and profiles, with the same seeds of episodes.

    Args:
        policies: Drivers, by the name to report.
        scenario: Name of the scenario.
        backends: Names of backends.
        profiles: Names of profiles.
        episodes: Number of episodes of each combination.
        keywords: Keywords of the environments; backend and profile are replaced.
        report: Function that is called after each combination.
    """
    rows = []
    for name, driver in policies.items():
        for backend in backends:
            for profile in profiles:
                chosen: Keywords = {
                    **(keywords or {}),
                    "backend": backend,
                    "profile": profile,
                }
                rows.append(
                    evaluate(
                        driver,
                        scenario,
                        episodes=episodes,
                        name=name,
                        exact=True,
                        **chosen,
                    )
                )
                report()
    return rows


def fine_tuning_config(run: Path, steps: int) -> PPOConfig:
    """Return the configuration that trains a run's policy further on robosuite.

    Args:
        run: Folder of the run.
        steps: Number of steps, summed over all worlds.

    Raises:
        ValueError: There is no run, or it is of an older version.
    """
    config = load_config(PPOConfig, run / "config.toml")
    return dataclasses.replace(config, **TUNING, init=str(run), total_steps=steps)


def pretraining_config(scenario: str, profile: str, seed: int) -> PPOConfig:
    """Return the preset for a scenario, on the 2D table (backend "numba")."""
    return preset(scenario, {"profile": profile, "seed": seed})


def plot_transfer(rows: Sequence[EvaluationResult], path: Path) -> None:
    """Plot success by policy: a panel for each profile, a colour for each backend."""
    import matplotlib.pyplot as plt

    from marl_airhockey.sim.render.charts import DPI, INK, INKS, save, tidy

    profiles = list(dict.fromkeys(row.profile for row in rows))
    backends = list(dict.fromkeys(row.backend for row in rows))
    policies = list(dict.fromkeys(row.driver for row in rows))[::-1]
    figure, grid = plt.subplots(
        1,
        len(profiles),
        figsize=(4.2 * len(profiles) + 1, 0.7 * len(policies) + 1.6),
        dpi=DPI,
        layout="constrained",
        sharey=True,
        squeeze=False,
    )
    for axes, profile in zip(grid[0], profiles, strict=True):
        for k, (backend, ink) in enumerate(zip(backends, (INK, *INKS), strict=False)):
            offset = 0.16 * (k - (len(backends) - 1) / 2)
            mine = [r for r in rows if (r.profile, r.backend) == (profile, backend)]
            heights = [policies.index(row.driver) - offset for row in mine]
            axes.hlines(
                heights,
                *zip(*(r.success_interval for r in mine), strict=True),
                color=ink,
            )
            axes.plot([r.success for r in mine], heights, "o", color=ink, label=backend)
        axes.set_yticks(range(len(policies)), policies)
        axes.set(
            xlim=(-0.03, 1.03),
            ylim=(-0.6, len(policies) - 0.4),
            xlabel=f"success, {profile} profile (95 %)",
        )
        tidy(axes, legend=None)
    grid[0, 0].legend(frameon=False, loc="best")
    save(figure, path)
