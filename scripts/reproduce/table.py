"""Compute the paper's Table I with one command: BC, IQL and RL in three domains.

    python scripts/reproduce/table.py --seeds 3 --jobs 2
    python scripts/reproduce/table.py --domain lab --jobs 1     # on an idle machine
    python scripts/reproduce/table.py --tier medium-expert --algos bc,bc10,iql,rebrac
    python scripts/reproduce/table.py --domain paper --algos random,rl --seeds 3
    python scripts/reproduce/table.py --domain paper --seeds 1

BC and IQL learn from 100,000 steps of an expert, with 20,000 and 40,000 gradient steps.
A finished cell adds a row to ``docs/data/offline.csv``. A cell that has a row is not
trained again, so the script can be interrupted. ``--again --rows mine.csv`` trains all
cells and writes the rows to another file.

* 2d: the data are ``airhockey/TASK/expert-v0``, or of another tier; 500 episodes on
  numba.
* robosuite: the data are of the zoo's policy on robosuite; 50 episodes on robosuite.
* lab: the data are of ``zoo/TASK_full_size`` in the profile ur5e; 20 episodes through
  the camera and the arm of the virtual lab.
* paper: rules, table and physics of the paper's code. The data are of seed 0 of rl,
  which is PPO with the presets; random are random actions.

Evaluations and recordings have different seeds. ``offline_tables.py`` prints the tables
of these rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rows import DATA, Again, Book, Row, RowsFile, in_folder, read, run_folder

from marl_airhockey import make_driver
from marl_airhockey.data.benchmark.build import get_dataset
from marl_airhockey.data.benchmark.catalogue import TASKS
from marl_airhockey.data.record import record_steps
from marl_airhockey.evaluation.evaluate import EvaluationResult, evaluate
from marl_airhockey.hardware.calibration.lab_rig import lab_rig
from marl_airhockey.learn.offline.config import offline_config
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.core.parameters import PRESETS
from marl_airhockey.sim.world.keywords import Keywords

ALGOS: dict[str, tuple[str, dict[str, Any]]] = {
    "bc": ("bc", {"total_steps": 20_000}),
    "bc10": ("bc", {"total_steps": 20_000, "share": 0.1}),
    "td3_bc": ("td3_bc", {"total_steps": 40_000}),
    "iql": ("iql", {"total_steps": 40_000}),
    "rebrac": ("rebrac", {"total_steps": 40_000}),
}
"""Algorithms and their settings by column. bc10 clones the best tenth of the
episodes."""
COLUMNS = ("random", *ALGOS, "rl")
"""Names of the columns of a table, to which rows belong."""
EXPERT = "expert"
SEED = 10_000_000
"""Seed of the first recorded episode, which no evaluation uses."""
FIELDS = (
    *("domain", "tier", "task", "algo", "seed", "success", "return", "episodes"),
    *("steps", "cpu_minutes"),
)


@dataclass(frozen=True)
class Domain:
    """Domain of the table."""

    tasks: tuple[str, ...]
    record: Callable[[str, str, Path], Path]
    """Function of a task, a tier and a folder that returns recordings."""
    measure: Callable[[Driver, str], EvaluationResult]
    """Function that evaluates a policy in a task."""


def _recorded(player: str, task: str, steps: int, folder: Path, env: Keywords) -> Path:
    """Return recordings of a policy, which are made if they do not exist."""
    if not folder.exists():
        record_steps(make_driver(player), player, task, steps, folder, SEED, env)
    return folder


def _in_2d(policy: Driver, task: str) -> EvaluationResult:
    return evaluate(policy, task, episodes=500, name=task, exact=True)


def _on_robosuite(policy: Driver, task: str) -> EvaluationResult:
    return evaluate(policy, task, episodes=50, name=task, backend="robosuite")


def _through_the_lab(policy: Driver, task: str) -> EvaluationResult:
    with lab_rig() as rig:
        return evaluate(policy, task, episodes=20, backend="real", rig=str(rig))


def paper_environment(task: str) -> Keywords:
    """Return rules, table and physics of the paper's code.

    In the paper's code, paddles have their half of the table and reach 2 m/s within one
    step. Here they need two steps. Strikes have a level table.
    """
    paddle = {"paddle_speed": 2.0, "paddle_acceleration": 20.0}
    level = {"tilt": 0.0} if task.startswith("strike") else {}
    return {
        "options": {"rules": "paper", "table": "full_size", "seats": "arcade"},
        "physics": {**PRESETS["authors"], **paddle, **level},
    }


def _of_rl(task: str, tier: str, folder: Path) -> Path:
    run = train_rl(task, 0, folder)
    policy, name = load_policy(run / "last.npz"), folder / f"paper-{task}"
    if not name.exists():
        settings = paper_environment(task)
        record_steps(policy, "rl", task, 100_000, name, SEED, settings)
    return name


def train_rl(task: str, seed: int, folder: Path) -> Path:
    """Train PPO under the paper's rules, unless it is trained; return its folder."""
    place = folder / f"paper-{task}-rl-{seed}"
    config = preset(task, {**paper_environment(task), "seed": seed})
    run_training(None if (place / "config.toml").exists() else config, place)
    return place


def _by_the_paper(player: Driver, task: str) -> EvaluationResult:
    settings = paper_environment(task)
    return evaluate(player, task, episodes=500, name=task, exact=True, **settings)


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
    "paper": Domain(TASKS, _of_rl, _by_the_paper),
}
"""Domains by name: tasks, recordings and evaluation."""


def train_cell(
    name: str, tier: str, task: str, column: str, seed: int, folder: Path
) -> Row:
    """Train one cell and return its row."""
    domain, steps, minutes = DOMAINS[name], 0, 0.0
    player: Driver = make_driver("random")
    if column != "random":
        place = folder / f"{name}-{tier}-{task}-{column}-{seed}"
        if column == "rl":
            place = train_rl(task, seed, folder)
        else:
            learn(domain.record(task, tier, folder), column, seed, place)
        last = read(place / "evaluations.csv")[-1]
        steps = int(last["steps"])
        minutes = round(float(last["learning_cpu_seconds"]) / 60, 2)
        player = load_policy(place / "last.npz")
    found = domain.measure(player, task)
    values = (
        *(name, tier, task, column, seed),
        *(round(found.success, 4), round(found.returns, 4), found.episodes),
        *(steps, minutes),
    )
    return dict(zip(FIELDS, values, strict=True))


def learn(data: Path, column: str, seed: int, place: Path) -> None:
    """Train the algorithm of a column from recordings into a folder, or resume it."""
    algo, settings = ALGOS[column]
    changes = {"seed": seed, "evaluations": 1, "eval_episodes": 50, **settings}
    config = offline_config(algo, [data], changes)
    run_training(None if (place / "config.toml").exists() else config, place)


def order(row: Row) -> tuple[Any, ...]:
    """Return the sort key of a row."""
    return (
        list(DOMAINS).index(row["domain"]),
        row["tier"],
        TASKS.index(row["task"]),
        COLUMNS.index(row["algo"]),
        int(row["seed"]),
    )


BOOK = Book(DATA / "offline.csv", ("domain", "tier", "task", "algo", "seed"), order)


def main(
    domain: Annotated[
        str, typer.Option(help="Name of the domain: 2d, robosuite, lab or paper.")
    ] = "2d",
    tier: Annotated[str, typer.Option(help="Tier of the datasets in 2d.")] = EXPERT,
    tasks: Annotated[
        str, typer.Option(help="Names of tasks, separated by commas; by default all.")
    ] = "",
    algos: Annotated[
        str, typer.Option(help="Names of algorithms, separated by commas.")
    ] = "bc,iql",
    seeds: Annotated[int, typer.Option(help="Number of runs of each cell.")] = 3,
    jobs: Annotated[int, typer.Option(help="Number of cells at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Folder of data and runs.")] = Path(
        "runs/table"
    ),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the cells that have no row."""
    chosen = tasks.split(",") if tasks else DOMAINS[domain].tasks
    book, place = BOOK.at(rows), run_folder(folder, again)
    cells = [
        (domain, tier, task, algo, seed)
        for seed in range(seeds)
        for algo in algos.split(",")
        for task in chosen
    ]
    wanted = book.missing(cells, again)
    learners = {cell[2] for cell in wanted if cell[3] in ALGOS}
    for task in sorted(learners, key=TASKS.index):  # Record once, for all processes.
        print(f"data of {task}", flush=True)
        DOMAINS[domain].record(task, tier, place)
    book.fill(wanted, partial(in_folder, train_cell, place), jobs)


if __name__ == "__main__":
    typer.run(main)
