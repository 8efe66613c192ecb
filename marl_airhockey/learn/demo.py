"""Demonstration of the library: learn a task, evaluate the policy and show it."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

from marl_airhockey.evaluation.evaluate import EvaluationResult, evaluate
from marl_airhockey.learn.plots import plot_learning_curve
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.run import ProgressCallback
from marl_airhockey.learn.train import run_training, versions
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.watch import show_episodes

BESIDE = ("still", "random", "striker")
"""Drivers that the learned policy is compared with."""
MOST_STEPS = 2_000_000
"""Default number of training steps of a demonstration, if the preset has more. Juggling
is learned in a quarter of them."""


def run_demo(
    scenario: str,
    out: Path,
    steps: int | None = None,
    report: ProgressCallback | None = None,
) -> tuple[list[EvaluationResult], dict[str, Path]]:
    """Train, evaluate, and write learning curve, video and report.

    Args:
        scenario: Name of the task to learn.
        out: Folder of the files. The run of an earlier demonstration in it is replaced.
        steps: Number of training steps, summed over all worlds; None for that of the
            preset, at most `MOST_STEPS`.
        report: Function that is called during training, see `train`.

    Returns:
        Results of the learned policy and of `BESIDE`, and the paths of the files by
        name.
    """
    folder = out / "run"
    if folder.exists():
        shutil.rmtree(folder)
    config = preset(scenario)
    steps = steps or min(config.total_steps, MOST_STEPS)
    last = run_training(replace(config, total_steps=steps), folder, report)
    policy = load_policy(folder)
    drivers = {name: make_driver(name) for name in BESIDE} | {"learned": policy}
    results = [
        evaluate(d, scenario, name=name, exact=True) for name, d in drivers.items()
    ]
    files = {
        "learning curve": out / "learning_curve.png",
        "video": out / f"{scenario}.gif",
        "report": out / "report.json",
        "run": folder,
    }
    with (folder / "evaluations.csv").open() as file:
        rows = list(csv.DictReader(file))
    floors = {r.driver: r.success for r in results if r.driver != "learned"}
    plot_learning_curve(rows, floors, scenario, files["learning curve"])
    show_episodes(
        scenario, policy, {}, seed=1, video=files["video"], width=560, seconds=10.0
    )
    report_data = {
        "scenario": scenario,
        "training": last,
        "results": [r.to_json() for r in results],
        "versions": versions(),
    }
    files["report"].write_text(json.dumps(report_data, indent=1))
    return results, files
