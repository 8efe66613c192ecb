"""The paper's Table I as one command: BC, IQL and RL in three domains.

    python scripts/reproduce/table.py --seeds 3 --jobs 2
    python scripts/reproduce/table.py --domain lab --jobs 1     # on an idle machine
    python scripts/reproduce/table.py --tier medium-expert --algos bc,bc10,iql,rebrac

BC and IQL learn from 100,000 steps of an expert, 20,000 and 40,000 steps of the
gradient. A cell that ends adds a row to ``docs/data/offline.csv``; one whose row is
there is not trained again, so the script can be stopped and started.

* 2d: data are ``airhockey/TASK/expert-v0``, or of another tier; 500 episodes on numba.
* robosuite: data are of the zoo's policy on robosuite; 50 episodes there.
* lab: data are of ``zoo/TASK_full_size`` in the profile ur5e; 20 episodes through the
  camera and the arm of the virtual lab.

No seed of an evaluation is that of a recording. ``offline_tables.py`` prints the
tables of these rows.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from marl_airhockey import make_agent
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.data.benchmark.build import get_dataset
from marl_airhockey.data.benchmark.catalogue import TASKS
from marl_airhockey.data.record import record_steps
from marl_airhockey.evaluation.evaluate import EvaluationResult, evaluate
from marl_airhockey.lab.calibration.lab_rig import lab_rig
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.world.build import Keywords

ALGOS: dict[str, tuple[str, dict[str, Any]]] = {
    "bc": ("bc", {"total_steps": 20_000}),
    "bc10": ("bc", {"total_steps": 20_000, "share": 0.1}),
    "td3_bc": ("td3_bc", {"total_steps": 40_000}),
    "iql": ("iql", {"total_steps": 40_000}),
    "rebrac": ("rebrac", {"total_steps": 40_000}),
}
"""Algorithms and their settings by column; bc10 clones the best tenth of episodes"""
EXPERT = "expert"
SEED = 10_000_000
"""Seed of the first recorded episode, far from those of evaluations"""
DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows"""
ROWS = DATA / "offline.csv"
FIELDS = (
    *("domain", "tier", "task", "algo", "seed", "success", "return", "episodes"),
    *("steps", "cpu_minutes"),
)
Row = dict[str, Any]


@dataclass(frozen=True)
class Domain:
    """Domain of the table."""

    tasks: tuple[str, ...]
    record: Callable[[str, str, Path], Path]
    """Function of a task, a tier and a folder that returns recordings"""
    measure: Callable[[Driver, str], EvaluationResult]
    """Function that evaluates a policy in a task"""


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


ROBOT_SIDE: Keywords = {"profile": "ur5e", "options": {"table": "full_size"}}
DOMAINS = {
    "2d": Domain(
        TASKS,
        lambda task, tier, folder: get_dataset(f"airhockey/{task}/{tier}-v0"),
        _in_2d,
    ),
    "robosuite": Domain(
        ("reach", "reach_velocity", "touch", "juggle", "puck_velocity", "hit_goal"),
        lambda task, tier, folder: _recorded(
            f"zoo/{task}",
            task,
            100_000,
            folder / f"robosuite-{task}",
            {"backend": "robosuite"},
        ),
        _on_robosuite,
    ),
    "lab": Domain(
        ("reach", "reach_velocity", "touch", "juggle", "puck_velocity"),
        lambda task, tier, folder: _recorded(
            f"zoo/{task}_full_size",
            task,
            100_000,
            folder / f"lab-{task}",
            ROBOT_SIDE,
        ),
        _through_the_lab,
    ),
}
"""Domains by name: tasks, recordings and evaluation"""


def train_cell(
    name: str, tier: str, task: str, column: str, seed: int, folder: Path
) -> Row:
    """Train one cell and return its row."""
    domain, (algo, settings) = DOMAINS[name], ALGOS[column]
    data = domain.record(task, tier, folder)
    changes = {"seed": seed, "evaluations": 1, "eval_episodes": 50, **settings}
    config = offline_config(algo, [data], changes)
    place = folder / f"{name}-{tier}-{task}-{column}-{seed}"
    row = run_training(None if (place / "config.toml").exists() else config, place)
    found = domain.measure(load_policy(place / "last.npz"), task)
    minutes = round(row["learning_cpu_seconds"] / 60, 2)
    values = (
        *(name, tier, task, column, seed),
        *(round(found.success, 4), round(found.returns, 4), found.episodes),
        *(int(row["steps"]), minutes),
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
            r["tier"],
            TASKS.index(r["task"]),
            list(ALGOS).index(r["algo"]),
            int(r["seed"]),
        )
    )
    draft = ROWS.with_suffix(".part")
    with draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(ROWS)


def main(
    domain: Annotated[str, typer.Option(help="2d, robosuite or lab.")] = "2d",
    tier: Annotated[str, typer.Option(help="Tier of the datasets of 2d.")] = EXPERT,
    tasks: Annotated[str, typer.Option(help="Comma-separated; all of them.")] = "",
    algos: Annotated[str, typer.Option(help="Comma-separated.")] = "bc,iql",
    seeds: Annotated[int, typer.Option(help="Runs of each cell.")] = 3,
    jobs: Annotated[int, typer.Option(help="Cells at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Folder of data and runs.")] = Path(
        "runs/table"
    ),
) -> None:
    """Train what has no row yet."""
    chosen = tasks.split(",") if tasks else DOMAINS[domain].tasks
    key = "domain", "tier", "task", "algo"
    known = {(*(r[name] for name in key), int(r["seed"])) for r in read(ROWS)}
    wanted = [
        (domain, tier, task, algo, seed)
        for seed in range(seeds)
        for algo in algos.split(",")
        for task in chosen
        if (domain, tier, task, algo, seed) not in known
    ]
    for task in {cell[2] for cell in wanted}:  # Once, not in each process.
        DOMAINS[domain].record(task, tier, folder)
    with ProcessPoolExecutor(jobs) as pool:
        cells = [pool.submit(train_cell, *cell, folder) for cell in wanted]
        for cell in as_completed(cells):
            keep(cell.result())
            print(cell.result(), flush=True)


if __name__ == "__main__":
    typer.run(main)
