"""Train every task with its preset over several seeds, print the table, draw curves.

    python scripts/reproduce_tasks.py --seeds 5 --jobs 2 --out runs/tasks
    python scripts/reproduce_tasks.py --profile ur5e --seeds 1 --out runs/ur5e

A run that is there already is not trained again, so the script can be stopped and
started. Success is that of the last policy (no checkpoint is picked) over the test
seeds, which training never sees: on the numba backend that it was trained on, on
pymunk, and with one control step of action delay that it was not trained with. The
paper's column is the row of Table I for RL in its 2D simulator (arXiv 2405.03113),
under the paper's own rules and physics.
"""

from __future__ import annotations

import csv
import json
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey import make_agent
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.config import preset
from marl_airhockey.learn.plots import plot_seed_curves
from marl_airhockey.learn.train import train
from marl_airhockey.toolkit.policies import load_policy
from marl_airhockey.world.build import Keywords

PAPER = {
    "reach": 1.0,
    "reach_velocity": 1.0,
    "touch": 1.0,
    "strike": 1.0,
    "strike_crowd": 1.0,
    "juggle": 1.0,
    "puck_velocity": 1.0,
    "move_block": 0.0,
    "hit_goal": 0.9,
    "hit_goal_velocity": 0.0,
}
"""Success of RL in the paper, by task"""
EPISODES = 2000
"""Episodes by which a policy is measured"""
THRESHOLDS = (0.5, 0.9, 0.95)
"""Levels of success to which the CPU time is reported"""
HEADERS = (
    *("task", "success", "worst seed", "95 % interval", "sampled", "first shot"),
    *("on pymunk", "delayed", "CPU-min", "M steps", "CPU-s to .5 / .9 / .95"),
    *("still", "random", "sticky", "paper's RL"),
)


def train_seed(scenario: str, profile: str, seed: int, folder: Path) -> dict[str, Any]:
    """Train one seed and measure its last policy; return the row of results."""
    result = folder / "result.json"
    if result.exists():
        return dict(json.loads(result.read_text()))
    config = preset(scenario, {"seed": seed, "profile": profile})
    train(None if (folder / "config.toml").exists() else config, folder)
    numba: Keywords = {"profile": profile, "backend": "numba"}
    pymunk: Keywords = {"profile": profile, "backend": "pymunk"}
    delayed: Keywords = {**numba, "physics": {"action_delay": 0.05}}
    cases = {
        "success": (True, numba),
        "sampled": (False, numba),
        "pymunk": (True, pymunk),
        "delayed": (True, delayed),
    }
    if scenario == "juggle":
        for hits in (10, 20):
            cases[f"{hits} hits"] = (True, {**numba, "options": {"hits": hits}})
    row: dict[str, Any] = {"scenario": scenario, "profile": profile, "seed": seed}
    for name, (mean, keywords) in cases.items():
        policy = load_policy(folder / "last.npz", deterministic=mean)
        found = evaluate(policy, name, scenario, EPISODES, keywords=keywords)
        row[name] = found.success
        if name == "success":
            row["first_shot"] = found.first_shot
            row["grade"] = found.deployability.grade
    curve = evaluations(folder)
    row["cpu_minutes"] = float(curve[-1]["cpu_seconds"]) / 60
    row["steps"] = int(curve[-1]["steps"])
    for level in THRESHOLDS:
        times = [float(c["cpu_seconds"]) for c in curve if float(c["success"]) >= level]
        row[f"cpu_seconds_to_{level}"] = times[0] if times else None
    result.write_text(json.dumps(row, indent=1))
    return row


def evaluations(folder: Path) -> list[dict[str, str]]:
    """Return the rows of a run's ``evaluations.csv``."""
    with (folder / "evaluations.csv").open() as file:
        return list(csv.DictReader(file))


def floors(scenario: str, profile: str) -> dict[str, float]:
    """Return the success of drivers without skill, by name."""
    keywords: Keywords = {"profile": profile, "backend": "numba"}
    return {
        name: evaluate(make_agent(name), name, scenario, EPISODES, 0, keywords).success
        for name in ("still", "random", "sticky")
    }


def main(
    tasks: Annotated[str, typer.Option(help="Comma-separated scenarios.")] = ",".join(
        PAPER
    ),
    seeds: Annotated[int, typer.Option(help="Seeds 0 .. n - 1.")] = 5,
    profile: Annotated[str, typer.Option(help="ideal, ur5e, gantry.")] = "ideal",
    jobs: Annotated[int, typer.Option(help="Processes at once.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/tasks"),
    markdown: Annotated[Path | None, typer.Option(help="Write the table here.")] = None,
) -> None:
    """Train all tasks, measure the policies, print a table, draw curves."""
    names = tasks.split(",")
    console = Console()
    folders = {
        (name, seed): out / f"{name}-{profile}-{seed}"
        for seed in range(seeds)
        for name in names
    }
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(jobs) as pool:
        futures = [
            pool.submit(train_seed, name, profile, seed, folder)
            for (name, seed), folder in folders.items()
        ]
        for future in as_completed(futures):
            rows.append(future.result())
            console.print_json(json.dumps(rows[-1]))
    by_task = {name: [row for row in rows if row["scenario"] == name] for name in names}
    lines = [line(name, found, profile) for name, found in by_task.items()]
    table = Table(
        *HEADERS, title=f"{profile} profile, {seeds} seeds, {EPISODES} episodes"
    )
    for cells in lines:
        table.add_row(*cells)
    console.print(table)
    for row in by_task.get("juggle", []):
        more = {k: v for k, v in row.items() if str(k).endswith(" hits")}
        console.print("juggle, seed", row["seed"], more)
    curves = {
        name: [evaluations(folders[name, seed]) for seed in range(seeds)]
        for name in names
    }
    picture = out / f"curves_{profile}.png"
    plot_seed_curves(curves, picture)
    console.print("learning curves:", picture)
    if markdown is not None:
        ruled = [HEADERS, ("---",) * len(HEADERS), *lines]
        text = "".join(f"| {' | '.join(cells)} |\n" for cells in ruled)
        markdown.write_text(text)


def line(name: str, rows: list[dict[str, Any]], profile: str) -> tuple[str, ...]:
    """Return the cells of a task: means over its seeds, and the floors."""

    def mean(key: str) -> float:
        return float(np.mean([row[key] for row in rows]))

    def seconds_to(level: float) -> str:
        times = [row[f"cpu_seconds_to_{level}"] for row in rows]
        return "-" if None in times else f"{np.mean(times):.0f}"

    low, high = interval(mean("success"), EPISODES * len(rows))
    floor = floors(name, profile)
    return (
        name,
        f"{mean('success'):.3f}",
        f"{min(row['success'] for row in rows):.3f}",
        f"{low:.3f}..{high:.3f}",
        f"{mean('sampled'):.3f}",
        f"{mean('first_shot'):.3f}",
        f"{mean('pymunk'):.3f}",
        f"{mean('delayed'):.3f}",
        f"{mean('cpu_minutes'):.1f}",
        f"{mean('steps') / 1e6:.1f}",
        " / ".join(seconds_to(level) for level in THRESHOLDS),
        *(f"{floor[k]:.3f}" for k in ("still", "random", "sticky")),
        f"{PAPER[name]:.1f}" if name in PAPER else "-",
    )


if __name__ == "__main__":
    typer.run(main)
