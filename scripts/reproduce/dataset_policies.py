"""Train the unfinished policies of the named datasets.

    python scripts/reproduce/dataset_policies.py

Each task is trained with its preset until it reaches half of the success of the expert,
which is the policy of the zoo. The policy at the evaluation nearest to this half is
`medium`. The policies at a third and at two thirds of its steps are `early` and
`middle`. Success is that of sampled actions, as in the datasets. The script takes about
ten minutes of one core. Tasks whose policies exist are not trained again without
``--again``.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from rows import Again

from marl_airhockey.data.benchmark.catalogue import SNAPSHOTS, TASKS, snapshot
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy

SEED = 1000
"""Seed of the training."""
UPDATE = 1024 * 32
"""Number of steps of an update; the policy is evaluated after each update."""
EPISODES = 500
HALF = 0.5


class EnoughError(Exception):
    """The policy has reached the required success."""


def success_of(path: Path, task: str, sampled: bool) -> float:
    """Return the success of a policy, with sampled or mean actions."""
    policy = load_policy(path, deterministic=not sampled)
    return evaluate(policy, task, episodes=EPISODES, name=task).success


def until(goal: float, folder: Path, task: str) -> Callable[[int, int, Metrics], None]:
    """Return a function that saves each evaluated policy and stops at a success."""
    kept = folder.with_name(f"{folder.name}-snapshots")
    kept.mkdir(parents=True, exist_ok=True)
    seen = set[float]()

    def report(steps: int, total: int, metrics: Metrics) -> None:
        if metrics and metrics["steps"] not in seen:
            seen.add(metrics["steps"])
            path = kept / f"{int(metrics['steps']):09d}.npz"
            shutil.copy(folder / "last.npz", path)
            if success_of(path, task, sampled=True) >= goal:
                raise EnoughError

    return report


def train_task(task: str, folder: Path) -> dict[str, float]:
    """Train a task and copy its three policies; return their success."""
    expert = success_of(
        Path(__file__).parents[2] / f"marl_airhockey/zoo/{task}.npz", task, False
    )
    usual = preset(task)
    config = preset(
        task,
        {"seed": SEED, "evaluations": usual.total_steps // UPDATE, "eval_episodes": 1},
    )
    with suppress(EnoughError):
        run_training(config, folder, until(HALF * expert, folder, task))
    paths = sorted(folder.with_name(f"{folder.name}-snapshots").iterdir())
    near = sorted(
        paths[-4:], key=lambda p: abs(success_of(p, task, True) - HALF * expert)
    )
    last = paths.index(near[0])
    picked = [paths[last // 3], paths[2 * last // 3], near[0]]
    found = {"expert": expert}
    for level, path in zip(SNAPSHOTS, picked, strict=True):
        shutil.copy(path, snapshot(task, level))
        found[level] = success_of(path, task, sampled=True)
    return found


def main(
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/medium"
    ),
    again: Again = False,
) -> None:
    """Train the tasks whose policies are missing."""
    for task in TASKS:
        if snapshot(task, "medium").exists() and not again:
            print(f"{task}: the policies exist; --again trains them again")
            continue
        for place in (out / task, out / f"{task}-snapshots"):
            shutil.rmtree(place, ignore_errors=True)
        found = train_task(task, out / task)
        print(task, {level: round(x, 3) for level, x in found.items()}, flush=True)


if __name__ == "__main__":
    typer.run(main)
