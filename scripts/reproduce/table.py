"""The paper's Table I as one command: BC, IQL and RL in three domains.

    python scripts/reproduce/table.py --seeds 3 --jobs 2
    python scripts/reproduce/table.py --domain lab --jobs 1     # on an idle machine
    python scripts/reproduce/table.py --seeds 0                 # the table, in Markdown

BC and IQL learn from 100,000 steps of an expert, 20,000 and 40,000 steps of the
gradient. A cell that ends adds a row to ``docs/data/offline.csv``; one whose row is
there is not trained again, so the script can be stopped and started.

* 2d: data are ``airhockey/TASK/expert-v0``; 500 episodes on numba.
* robosuite: data are 20,000 steps of the zoo's policy on robosuite; 50 episodes there.
* lab: data are of ``zoo/TASK_full_size`` in the profile ur5e; 20 episodes through the
  camera and the arm of the virtual lab.

RL is that of ``reproduce/tasks.py`` (columns success and arm of ``tasks.csv``) and, in
the lab, of ``bench/lab_tasks.py``. No seed of an evaluation is that of a recording. The
paper's figures (arXiv 2405.03113) are of its own rules, physics and data.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from marl_airhockey import make_agent
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.data.benchmark.build import get_dataset
from marl_airhockey.data.record import record_steps
from marl_airhockey.evaluation.evaluate import EvaluationResult, evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.lab.calibration.lab_rig import lab_rig
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.world.build import Keywords

STEPS = {"bc": 20_000, "iql": 40_000}
"""Steps of the gradient by algorithm"""
SEED = 10_000_000
"""Seed of the first recorded episode, far from those of evaluations"""
DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows"""
ROWS = DATA / "offline.csv"
FIELDS = (
    *("domain", "task", "algo", "seed", "success", "return", "episodes"),
    *("steps", "cpu_minutes"),
)
Row = dict[str, Any]
Paper = tuple[float | None, float | None, float | None]


@dataclass(frozen=True)
class Domain:
    """Domain of the table."""

    paper: dict[str, Paper]
    """Success of BC, IQL and RL in the paper, by task; None where it has no figure"""
    record: Callable[[str, Path], Path]
    """Function of a task and a folder that returns the expert's recordings"""
    measure: Callable[[Driver, str], EvaluationResult]
    """Function that evaluates a policy in a task"""
    rl: Callable[[str], tuple[float, int] | None]
    """Function that returns the success of RL and its episodes"""


def _recorded(player: str, task: str, steps: int, folder: Path, env: Keywords) -> Path:
    """Return recordings of a policy, made now if they are not there."""
    if not folder.exists():
        record_steps(make_agent(player), player, task, steps, folder, SEED, env)
    return folder


def _in_2d(policy: Driver, task: str) -> EvaluationResult:
    return evaluate(policy, task, episodes=500, name=task, exact=True)


def _on_robosuite(policy: Driver, task: str) -> EvaluationResult:
    return evaluate(policy, task, episodes=50, name=task, backend="robosuite")


def _through_the_lab(policy: Driver, task: str) -> EvaluationResult:
    with lab_rig() as rig:
        return evaluate(policy, task, episodes=20, backend="real", rig=str(rig))


def _trained(column: str, episodes: int) -> Callable[[str], tuple[float, int] | None]:
    """Return a function that gives the mean over seeds of a column of `tasks.csv`."""

    def rl(task: str) -> tuple[float, int] | None:
        rows = [r for r in read(DATA / "tasks.csv") if _is(r, task)]
        values = [float(row[column]) for row in rows]
        return (float(np.mean(values)), episodes * len(values)) if values else None

    return rl


def _is(row: Row, task: str) -> bool:
    return (row["task"], row["profile"], row["variant"]) == (task, "ideal", "")


def _rl_in_lab(task: str) -> tuple[float, int] | None:
    rows = {row["task"]: row for row in read(DATA / "lab_tasks.csv")}
    return (float(rows[task]["lab"].split()[0]), 20) if task in rows else None


ROBOT_SIDE: Keywords = {"profile": "ur5e", "options": {"table": "full_size"}}
DOMAINS = {
    "2d": Domain(
        {
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
        },
        lambda task, folder: get_dataset(f"airhockey/{task}/expert-v0"),
        _in_2d,
        _trained("success", 2000),
    ),
    "robosuite": Domain(
        {
            "reach": (0.9, 0.9, 1.0),
            "reach_velocity": (0.8, 0.9, 1.0),
            "touch": (0.8, 0.8, 1.0),
            "juggle": (0.6, 0.7, 0.9),
            "puck_velocity": (0.6, 0.8, 0.9),
            "hit_goal": (0.1, 0.1, 0.2),
        },
        lambda task, folder: _recorded(
            f"zoo/{task}",
            task,
            20_000,
            folder / f"robosuite-{task}",
            {"backend": "robosuite"},
        ),
        _on_robosuite,
        _trained("arm", 200),
    ),
    "lab": Domain(
        {
            "reach": (0.9, 1.0, None),
            "reach_velocity": (0.1, 0.0, None),
            "touch": (0.3, 0.6, None),
            "juggle": (None, None, None),
            "puck_velocity": (0.1, 0.3, None),
        },
        lambda task, folder: _recorded(
            f"zoo/{task}_full_size",
            task,
            100_000,
            folder / f"lab-{task}",
            ROBOT_SIDE,
        ),
        _through_the_lab,
        _rl_in_lab,
    ),
}


def train_cell(name: str, task: str, algo: str, seed: int, folder: Path) -> Row:
    """Train one cell and return its row."""
    domain = DOMAINS[name]
    data = domain.record(task, folder)
    changes = {"seed": seed, "total_steps": STEPS[algo], "evaluations": 1}
    config = offline_config(algo, [data], {**changes, "eval_episodes": 50})
    place = folder / f"{name}-{task}-{algo}-{seed}"
    row = run_training(None if (place / "config.toml").exists() else config, place)
    found = domain.measure(load_policy(place / "last.npz"), task)
    minutes = round(row["learning_cpu_seconds"] / 60, 2)
    values = (
        *(name, task, algo, seed, round(found.success, 4), round(found.returns, 4)),
        *(found.episodes, int(row["steps"]), minutes),
    )
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
    domains = list(DOMAINS)
    rows.sort(
        key=lambda r: (
            domains.index(r["domain"]),
            list(DOMAINS[r["domain"]].paper).index(r["task"]),
            r["algo"],
            int(r["seed"]),
        )
    )
    draft = ROWS.with_suffix(".part")
    with draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(ROWS)


def table_of(name: str, rows: list[Row]) -> list[list[str]]:
    """Return the cells of a domain's table, the header first."""
    found = [["task", *(a.upper() for a in STEPS), "RL", "paper: BC, IQL, RL"]]
    domain = DOMAINS[name]
    for task, paper in domain.paper.items():
        cells = []
        for algo in STEPS:
            own = [
                r
                for r in rows
                if (r["domain"], r["task"], r["algo"]) == (name, task, algo)
            ]
            values = [float(row["success"]) for row in own]
            episodes = sum(int(row["episodes"]) for row in own)
            cells.append(shown(float(np.mean(values)), episodes) if values else "-")
        rl = domain.rl(task)
        cells.append(shown(*rl) if rl else "-")
        figures = ", ".join("-" if value is None else f"{value:.1f}" for value in paper)
        found.append([task, *cells, figures])
    return found


def shown(mean: float, episodes: int) -> str:
    """Return a success with its 95 % interval over all episodes."""
    low, high = interval(mean, episodes)
    return f"{mean:.3f} ({low:.3f} .. {high:.3f})"


def print_tables() -> None:
    """Print the tables of all domains in Markdown."""
    rows = read(ROWS)
    for name in DOMAINS:
        header, *lines = table_of(name, rows)
        print(f"\n{name}\n")
        for cells in (header, ["---"] * len(header), *lines):
            print(f"| {' | '.join(cells)} |")


def main(
    domain: Annotated[str, typer.Option(help="2d, robosuite or lab.")] = "2d",
    tasks: Annotated[str, typer.Option(help="Comma-separated; all of them.")] = "",
    seeds: Annotated[int, typer.Option(help="Runs of each cell.")] = 3,
    jobs: Annotated[int, typer.Option(help="Cells at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Folder of data and runs.")] = Path(
        "runs/table"
    ),
) -> None:
    """Train what has no row yet, then print the tables."""
    chosen = tasks.split(",") if tasks else list(DOMAINS[domain].paper)
    known = {(r["domain"], r["task"], r["algo"], int(r["seed"])) for r in read(ROWS)}
    wanted = [
        (domain, task, algo, seed)
        for seed in range(seeds)
        for algo in STEPS
        for task in chosen
        if (domain, task, algo, seed) not in known
    ]
    for task in {task for _, task, _, _ in wanted}:  # Once, not in each process.
        DOMAINS[domain].record(task, folder)
    with ProcessPoolExecutor(jobs) as pool:
        cells = [pool.submit(train_cell, *cell, folder) for cell in wanted]
        for cell in as_completed(cells):
            keep(cell.result())
            print(cell.result(), flush=True)
    print_tables()


if __name__ == "__main__":
    typer.run(main)
