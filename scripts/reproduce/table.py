"""Learn every task from recordings of its expert, beside learning by playing.

    python scripts/reproduce/table.py --seeds 5 --jobs 2
    python scripts/reproduce/table.py --seeds 0           # the table

The data of a task are 300 episodes of the zoo's policy for it, recorded once in
``runs/table``; from them BC and IQL learn, 5 seeds each. A cell that ends adds a row to
``docs/data/offline.csv``; one whose row is there is not trained again, so the script
can be stopped and started. The column RL is that of ``reproduce/tasks.py``.

Success is that of the last policy over 500 test seeds, which neither training nor the
recordings have seen. The paper's figures are those of Table I in its 2D simulator
(arXiv 2405.03113), under its own rules, physics and data.
"""

from __future__ import annotations

import csv
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from marl_airhockey import make_agent
from marl_airhockey.data.record import record_episodes
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.offline.config import ALGORITHMS, offline_config
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy

PAPER = {
    "reach": (0.9, 1.0, 1.0),
    "reach_velocity": (0.8, 1.0, 1.0),
    "touch": (1.0, 1.0, 1.0),
    "strike": (0.7, 1.0, 1.0),
    "strike_crowd": (0.3, 1.0, 1.0),
    "juggle": (0.3, 1.0, 1.0),
    "puck_velocity": (0.7, 1.0, 1.0),
    "move_block": (0.0, 0.0, 0.0),
    "hit_goal": (0.1, 0.4, 0.9),
    "hit_goal_velocity": (0.0, 0.0, 0.0),
}
"""Success of BC, IQL and RL in the paper, by task"""
RECORDED, RECORDING_SEED = 300, 10_000_000
"""Episodes of a task's data, and the seed of the first"""
EPISODES = 500
"""Episodes by which a policy is measured"""
DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows"""
ROWS = DATA / "offline.csv"
FIELDS = ("task", "algo", "seed", "success", "return", "steps", "cpu_minutes")
Row = dict[str, Any]


def recordings_of(task: str, folder: Path) -> Path:
    """Return the folder of a task's data, recorded now as far as it is not there."""
    place = folder / f"data-{task}"
    expert = f"zoo/{task}"
    seed = RECORDING_SEED
    record_episodes(make_agent(expert), expert, task, RECORDED, place, seed, {})
    return place


def train_cell(task: str, algo: str, seed: int, folder: Path) -> Row:
    """Train one cell and return its row."""
    config = offline_config(algo, [folder / f"data-{task}"], {"seed": seed})
    place = folder / f"{task}-{algo}-{seed}"
    row = run_training(None if (place / "config.toml").exists() else config, place)
    policy = load_policy(place / "last.npz")
    found = evaluate(
        policy, task, episodes=EPISODES, name=algo, exact=True, **config.keywords
    )
    minutes = round(row["cpu_seconds"] / 60, 2)
    values = task, algo, seed, found.success, found.returns, int(row["steps"]), minutes
    return dict(zip(FIELDS, values, strict=True))


def read(path: Path) -> list[Row]:
    """Return the rows of a CSV file; none if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def keep(row: Row) -> None:
    """Add a row to those there are, in order."""
    rows = [*read(ROWS), {name: str(value) for name, value in row.items()}]
    rows.sort(key=lambda r: (list(PAPER).index(r["task"]), r["algo"], int(r["seed"])))
    draft = ROWS.with_suffix(".part")
    with draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(ROWS)


def print_table() -> None:
    """Print means over seeds with the worst seed, and the paper's figures."""
    table = Table("task", *ALGORITHMS, "RL", "paper: BC, IQL, RL", "CPU-min: BC, IQL")
    rows = read(ROWS)
    played = [r for r in read(DATA / "tasks.csv") if r["profile"] == "ideal"]
    for task, paper in PAPER.items():
        cells, minutes = [], []
        for algo in ALGORITHMS:
            mine = [r for r in rows if (r["task"], r["algo"]) == (task, algo)]
            cells.append(shown([float(r["success"]) for r in mine]))
            spent = [float(r["cpu_minutes"]) for r in mine]
            minutes.append(f"{np.mean(spent):.1f}" if spent else "-")
        cells.append(shown([float(r["success"]) for r in played if r["task"] == task]))
        figures = ", ".join(f"{value:.1f}" for value in paper)
        table.add_row(task, *cells, figures, ", ".join(minutes))
    Console(width=120).print(table)


def shown(values: list[float]) -> str:
    """Return a mean over seeds, its interval over all episodes, and the worst seed."""
    if not values:
        return "-"
    mean = float(np.mean(values))
    low, high = interval(mean, EPISODES * len(values))
    return f"{mean:.3f} ({low:.2f}..{high:.2f}), {min(values):.2f}"


def main(
    tasks: Annotated[list[str] | None, typer.Argument(help="All by default.")] = None,
    seeds: Annotated[int, typer.Option(help="Runs of each cell.")] = 5,
    jobs: Annotated[int, typer.Option(help="Cells at once.")] = 2,
    folder: Annotated[Path, typer.Option(help="Of data and runs.")] = Path(
        "runs/table"
    ),
) -> None:
    """Train what has no row yet, then print the table."""
    chosen = tasks or list(PAPER)
    done = {(r["task"], r["algo"], int(r["seed"])) for r in read(ROWS)}
    wanted = [
        (task, algo, seed)
        for seed in range(seeds)
        for algo in ALGORITHMS
        for task in chosen
        if (task, algo, seed) not in done
    ]
    for task in {task for task, _, _ in wanted}:
        recordings_of(task, folder)
    with ProcessPoolExecutor(jobs) as pool:
        cells = [pool.submit(train_cell, *cell, folder) for cell in wanted]
        for cell in as_completed(cells):
            keep(cell.result())
            print(cell.result(), flush=True)
    print_table()


if __name__ == "__main__":
    typer.run(main)
