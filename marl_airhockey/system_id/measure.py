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
    from marl_airhockey.sim.render.charts import panels, point, save, series

    profiles = list(dict.fromkeys(row.profile for row in rows))
    backends = list(dict.fromkeys(row.backend for row in rows))
    policies = list(dict.fromkeys(row.driver for row in rows))
    size = 4.2 * len(profiles) + 1, 0.7 * len(policies) + 1.9
    figure, (grid,) = panels(1, len(profiles), size, share_y=True)
    for axes, profile in zip(grid, profiles, strict=True):
        for row in (row for row in rows if row.profile == profile):
            k = backends.index(row.backend)
            offset = 0.16 * (k - (len(backends) - 1) / 2)
            height = policies.index(row.driver) + offset
            label = f"{row.backend}, n = {row.episodes} episodes"
            point(axes, height, row.success, row.success_interval, series(k), label)
        axes.set_yticks(range(len(policies)), policies)
        axes.set(
            xlim=(-0.03, 1.03),
            ylim=(len(policies) - 0.4, -0.6),
            xlabel=f"success, {profile} profile (95 % interval)",
        )
    save(figure, path, "Success by policy and backend")
