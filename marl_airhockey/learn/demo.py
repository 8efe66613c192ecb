"""The demonstration: learn a task, measure it beside others, and show it."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

from marl_airhockey.evaluation.evaluate import Result, evaluate
from marl_airhockey.evaluation.watch import film
from marl_airhockey.learn.config import preset
from marl_airhockey.learn.plots import learning_curve
from marl_airhockey.learn.run import Report
from marl_airhockey.learn.train import train, versions
from marl_airhockey.registry import make_agent
from marl_airhockey.toolkit.policies import load_policy

BESIDE = ("still", "random", "striker")


def run(
    scenario: str, out: Path, steps: int | None = None, report: Report | None = None
) -> tuple[list[Result], dict[str, Path]]:
    """Train, evaluate, and write curve, film and report.

    Args:
        scenario: what to learn.
        out: folder; what an earlier demonstration left there is replaced.
        steps: of single worlds; None for the preset's.
        report: see `train`.

    Returns:
        Results of the learned policy and of those beside it, and the files.
    """
    folder = out / "run"
    if folder.exists():
        shutil.rmtree(folder)
    changes = {} if steps is None else {"total_steps": steps}
    last = train(preset(scenario, changes), folder, report)
    policy = load_policy(folder)
    drivers = {name: make_agent(name) for name in BESIDE} | {"learned": policy}
    results = [evaluate(d, name, scenario) for name, d in drivers.items()]
    files = {
        "learning curve": out / "learning_curve.png",
        "film": out / f"{scenario}.gif",
        "report": out / "report.json",
        "run": folder,
    }
    with (folder / "evaluations.csv").open() as file:
        rows = list(csv.DictReader(file))
    floors = {r.driver: r.success for r in results if r.driver != "learned"}
    learning_curve(rows, floors, scenario, files["learning curve"])
    film(scenario, policy, {}, seed=1, video=files["film"], width=560, seconds=10.0)
    report_data = {
        "scenario": scenario,
        "training": last,
        "results": [r.to_json() for r in results],
        "versions": versions(),
    }
    files["report"].write_text(json.dumps(report_data, indent=1))
    return results, files
