"""Sim to sim: how policies do in physics that they were not trained in."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate
from marl_airhockey.learn.config import TrainConfig, load_config, preset
from marl_airhockey.world.build import Keywords

TUNING: dict[str, Any] = {
    "backend": "robosuite",
    "num_worlds": 32,
    "n_steps": 64,
    "batch_size": 512,
    "learning_rate": 5e-5,
    "highest_rate": 1e-4,
    "evaluations": 5,
    "eval_episodes": 50,
}
"""What changes when a policy is trained on where it is to be used."""


@dataclass(frozen=True)
class Transfer:
    """A policy's success in one world that it did not know, or did."""

    policy: str
    backend: str
    profile: str
    episodes: int
    success: float
    interval: tuple[float, float]
    """95 %, Wilson's."""

    def to_json(self) -> dict[str, Any]:
        """For a report."""
        return asdict(self)


def measure(
    policies: dict[str, Driver],
    scenario: str,
    backends: Sequence[str],
    profiles: Sequence[str],
    episodes: int = 200,
    keywords: Keywords | None = None,
    report: Callable[[], None] = lambda: None,
) -> list[Transfer]:
    """Evaluate policies in all backends and profiles, on the same episodes' seeds.

    Args:
        policies: by what to call them.
        scenario: what they play.
        backends: names.
        profiles: names.
        episodes: of each.
        keywords: of the environments, but for these two.
        report: called after each.
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
                found = evaluate(driver, name, scenario, episodes, TEST_SEED, chosen)
                shown = found.success, found.success_interval
                rows.append(Transfer(name, backend, profile, episodes, *shown))
                report()
    return rows


def tuned(run: Path, steps: int) -> TrainConfig:
    """The configuration that trains a run's policy further on robosuite.

    Args:
        run: folder of the run.
        steps: of single worlds.
    """
    config = load_config(run / "config.toml")
    return dataclasses.replace(config, **TUNING, init=str(run), total_steps=steps)


def schooled(scenario: str, profile: str, seed: int) -> TrainConfig:
    """The preset for a scenario, in the batched 2D table."""
    return preset(scenario, {"profile": profile, "seed": seed})


def picture(rows: Sequence[Transfer], path: Path) -> None:
    """Success by policy, a panel for each profile, a colour for each backend."""
    import matplotlib.pyplot as plt

    from marl_airhockey.evaluation.charts import DPI, INK, INKS, save, tidy

    profiles = list(dict.fromkeys(row.profile for row in rows))
    backends = list(dict.fromkeys(row.backend for row in rows))
    policies = list(dict.fromkeys(row.policy for row in rows))[::-1]
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
            off = 0.16 * (k - (len(backends) - 1) / 2)
            mine = [r for r in rows if (r.profile, r.backend) == (profile, backend)]
            at = [policies.index(row.policy) - off for row in mine]
            axes.hlines(at, *zip(*(r.interval for r in mine), strict=True), color=ink)
            axes.plot([r.success for r in mine], at, "o", color=ink, label=backend)
        axes.set_yticks(range(len(policies)), policies)
        axes.set(
            xlim=(-0.03, 1.03),
            ylim=(-0.6, len(policies) - 0.4),
            xlabel=f"success, {profile} profile (95 %)",
        )
        tidy(axes, legend=None)
    grid[0, 0].legend(frameon=False, loc="best")
    save(figure, path)
