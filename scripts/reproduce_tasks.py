"""Train every task with its preset over several seeds and print the table.

    python scripts/reproduce_tasks.py --seeds 5 --jobs 2 --out runs/tasks
    python scripts/reproduce_tasks.py --profile robot --seeds 1 --out runs/robot

A run that is there already is not trained again, so the script can be stopped and
started. Success is that of the last policy (no checkpoint is picked) over the test
seeds, which training never sees.
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
from marl_airhockey.learn.config import preset
from marl_airhockey.learn.policy import load_policy
from marl_airhockey.learn.train import train
from marl_airhockey.make import Keywords
from marl_airhockey.match import evaluate

TASKS = (
    "reach,reach_velocity,touch,strike,strike_crowd,juggle,puck_velocity,"
    "move_block,hit_goal,hit_goal_velocity"
)
EPISODES = 1000


def run(scenario: str, profile: str, seed: int, folder: Path) -> dict[str, Any]:
    """Train one seed and judge its last policy."""
    result = folder / "result.json"
    if result.exists():
        return dict(json.loads(result.read_text()))
    config = preset(scenario, {"seed": seed, "profile": profile})
    train(None if (folder / "config.toml").exists() else config, folder)
    keywords: Keywords = {"profile": profile}
    row: dict[str, Any] = {"scenario": scenario, "profile": profile, "seed": seed}
    for name, mean in (("deterministic", True), ("sampled", False)):
        policy = load_policy(folder / "last.zip", deterministic=mean)
        found = evaluate(policy, name, scenario, EPISODES, keywords=keywords)
        row[name] = found.success
        if mean:
            row["first_shot"], row["grade"] = (
                found.first_shot,
                found.deployability.grade,
            )
    with (folder / "evaluations.csv").open() as file:
        curve = list(csv.DictReader(file))
    row["cpu_minutes"] = float(curve[-1]["cpu_seconds"]) / 60
    row["steps"] = int(curve[-1]["steps"])
    for bar in (0.5, 0.9, 0.95):
        times = [float(c["cpu_seconds"]) for c in curve if float(c["success"]) >= bar]
        row[f"cpu_seconds_to_{bar}"] = times[0] if times else None
    result.write_text(json.dumps(row, indent=1))
    return row


def floors(scenario: str, profile: str) -> dict[str, float]:
    """Success of the drivers that know nothing."""
    keywords: Keywords = {"profile": profile}
    return {
        name: evaluate(make_agent(name), name, scenario, EPISODES, 0, keywords).success
        for name in ("still", "random", "sticky")
    }


def main(
    tasks: Annotated[str, typer.Option(help="Comma-separated scenarios.")] = TASKS,
    seeds: Annotated[int, typer.Option(help="Seeds 0 .. n - 1.")] = 5,
    profile: Annotated[str, typer.Option(help="ideal or robot.")] = "ideal",
    jobs: Annotated[int, typer.Option(help="Processes at once.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/tasks"),
    markdown: Annotated[Path | None, typer.Option(help="Write the table here.")] = None,
) -> None:
    """Train, judge, print."""
    names = tasks.split(",")
    wanted = [(name, seed) for seed in range(seeds) for name in names]
    console = Console()
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(jobs) as pool:
        waiting = [
            pool.submit(run, name, profile, seed, out / f"{name}-{profile}-{seed}")
            for name, seed in wanted
        ]
        for future in as_completed(waiting):
            rows.append(future.result())
            console.print_json(json.dumps(rows[-1]))
    heads = (
        *("task", "success", "worst seed", "sampled", "first shot", "CPU-min"),
        *("M steps", "CPU-s to 0.9", "still", "random", "sticky"),
    )
    lines = [
        line(name, [row for row in rows if row["scenario"] == name], profile)
        for name in names
    ]
    table = Table(
        *heads, title=f"{profile} profile, {seeds} seeds, {EPISODES} episodes"
    )
    for cells in lines:
        table.add_row(*cells)
    console.print(table)
    if markdown is not None:
        ruled = [heads, ("---",) * len(heads), *lines]
        text = "".join(f"| {' | '.join(cells)} |\n" for cells in ruled)
        markdown.write_text(text)


def line(name: str, rows: list[dict[str, Any]], profile: str) -> tuple[str, ...]:
    """The cells of a task: means over its seeds, and the floors."""

    def mean(key: str) -> float:
        return float(np.mean([row[key] for row in rows]))

    late = [row["cpu_seconds_to_0.9"] for row in rows]
    ground = floors(name, profile)
    return (
        name,
        f"{mean('deterministic'):.3f}",
        f"{min(row['deterministic'] for row in rows):.3f}",
        f"{mean('sampled'):.3f}",
        f"{mean('first_shot'):.3f}",
        f"{mean('cpu_minutes'):.1f}",
        f"{mean('steps') / 1e6:.1f}",
        "-" if None in late else f"{np.mean(late):.0f}",
        *(f"{ground[k]:.3f}" for k in ("still", "random", "sticky")),
    )


if __name__ == "__main__":
    typer.run(main)
