"""Train SAC with hindsight goals in the four tasks with goals, in three variants.

    python scripts/reproduce/hindsight.py --tasks reach --variants recorded,relabelled
    python scripts/reproduce/hindsight.py --variants relabelled,tqc

The variants are relabelled (the default), recorded (terminations of the former goals)
and tqc (quantile critics, with relabelled terminations). A finished run adds a row to
``docs/data/hindsight.csv``: success of the last policy over 500 test seeds, steps,
CPU-minutes, and the steps of the first evaluation with a success of 0.9. A run that has
a row is not trained again, and an interrupted run is resumed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rows import DATA, Again, Book, Row, RowsFile, compute, read

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.hindsight.config import hindsight_config
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy

STEPS = {
    "reach": 60_000,
    "reach_velocity": 200_000,
    "hit_goal": 300_000,
    "hit_goal_velocity": 300_000,
}
"""Number of steps, summed over all worlds, by task."""
VARIANTS: dict[str, dict[str, Any]] = {
    "recorded": {"ends": "recorded"},
    "relabelled": {},
    "tqc": {"critics": "quantiles"},
}
"""Settings by the name of a variant."""
KEY = ("task", "variant", "seed")
EPISODES = 500


def train_run(task: str, variant: str, seed: int, folder: Path) -> Row:
    """Train one run and return its row."""
    steps = STEPS[task]
    changes = {"total_steps": steps, "seed": seed, "evaluations": 12}
    config = hindsight_config(task, {**changes, **VARIANTS[variant]})
    place = folder / f"{task}-{variant}-{seed}"
    row = run_training(None if (place / "config.toml").exists() else config, place)
    policy = load_policy(place / "last.npz")
    found = evaluate(
        policy, task, episodes=EPISODES, name=task, exact=True, **config.keywords
    )
    reached = [
        each
        for each in read(place / "evaluations.csv")
        if float(each["success"]) >= 0.9
    ]
    return {
        **dict(zip(KEY, (task, variant, seed), strict=True)),
        "success": round(found.success, 4),
        "steps": int(row["steps"]),
        "cpu_minutes": round(row["learning_cpu_seconds"] / 60, 1),
        "steps_to_0.9": int(float(reached[0]["steps"])) if reached else "",
    }


def order(row: Row) -> tuple[Any, ...]:
    """Return the sort key of a row."""
    return list(STEPS).index(row["task"]), row["variant"], int(row["seed"])


BOOK = Book(DATA / "hindsight.csv", KEY, order)


def main(
    tasks: Annotated[
        str, typer.Option(help="Names of tasks, separated by commas.")
    ] = ",".join(STEPS),
    variants: Annotated[
        str, typer.Option(help="Names of variants, separated by commas.")
    ] = ",".join(VARIANTS),
    seeds: Annotated[
        int, typer.Option(help="Number of runs of each task and variant.")
    ] = 1,
    jobs: Annotated[int, typer.Option(help="Number of runs at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/hindsight"
    ),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the runs that have no row."""
    cells = [
        (task, variant, seed)
        for seed in range(seeds)
        for task in tasks.split(",")
        for variant in variants.split(",")
    ]
    compute(BOOK.at(rows), cells, train_run, folder, jobs, again)


if __name__ == "__main__":
    typer.run(main)
