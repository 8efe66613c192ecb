"""Learn from images of the table, and compare with cloning from states.

    python scripts/reproduce/image_policies.py --jobs 2

The data of cloning are ``airhockey/TASK/expert-v0``, 100,000 steps of an expert. A
ResNet-18 takes longer for a gradient step than the small network, so it makes fewer of
them. PPO learns from images without data. A cell that has a row is not
trained again.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from statistics import mean
from typing import Annotated, Any, NamedTuple

import typer
from rich.console import Console
from rich.table import Table
from rows import DATA, Again, Book, Cell, Row, RowsFile, read

from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.train import run_training, train
from marl_airhockey.policies.load import load_policy

TASKS = ("reach", "touch", "juggle", "hit_goal")
EPISODES = 500


class Method(NamedTuple):
    """Method of a row."""

    tasks: tuple[str, ...]
    seeds: int
    algo: str
    settings: dict[str, Any]


IMAGES = {"observe": "pixels:colour=rgb", "evaluations": 2}
CAMERA = {**IMAGES, "observe": "camera:colour=rgb"}
LARGE = {**IMAGES, "network": "resnet18", "batch_size": 32}
LEARNED = {
    **{"observe": "pixels:size=64", "num_worlds": 64, "n_steps": 64},
    **{"batch_size": 256, "evaluations": 4},
}
METHODS = {
    "states": Method(TASKS, 2, "bc", {"evaluations": 2}),
    "images": Method(TASKS, 1, "bc", IMAGES),
    "camera": Method(TASKS, 1, "bc", CAMERA),
    "longer": Method(
        ("juggle", "hit_goal"), 1, "bc", {**IMAGES, "total_steps": 30_000}
    ),
    "PPO": Method(("reach", "touch"), 1, "ppo", LEARNED),
    "ResNet-18": Method(("reach",), 1, "bc", {**LARGE, "total_steps": 1000}),
}
"""Methods by name."""
FIELDS = ("task", "method", "seed", "steps", "success", "low", "high", "cpu_minutes")
BOOK = Book(
    DATA / "image_policies.csv",
    FIELDS[:3],
    lambda row: (
        list(METHODS).index(row["method"]),
        TASKS.index(row["task"]),
        row["seed"],
    ),
)


def measure(out: Path, task: str, method: str, seed: int) -> Row:
    """Train a method, unless it is trained, and return its row."""
    tried = METHODS[method]
    folder = out / f"{task}-{method.replace(', ', '-')}-{seed}"
    if (folder / "config.toml").exists():
        run_training(None, folder)
    else:
        data = f"airhockey/{task}/expert-v0" if tried.algo == "bc" else ()
        settings = {**tried.settings, "seed": seed}
        train(task, folder, algo=tried.algo, data=data, **settings)
    last = read(folder / "evaluations.csv")[-1]
    files = [folder / f"last.{kind}" for kind in ("onnx", "npz", "zip")]
    policy = load_policy(next(file for file in files if file.exists()))
    found = evaluate(policy, task, episodes=EPISODES, seed=TEST_SEED, exact=True)
    low, high = interval(found.success, EPISODES)
    numbers = (round(x, 4) for x in (found.success, low, high))
    minutes = round(float(last["learning_cpu_seconds"]) / 60, 1)
    values = task, method, seed, int(last["steps"]), *numbers, minutes
    return dict(zip(FIELDS, values, strict=True))


def summary(rows: list[Row]) -> list[list[str]]:
    """Return the lines of the table: success by task, and the mean CPU-minutes."""
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        cells = [method]
        for task in TASKS:
            found = [float(r["success"]) for r in own if r["task"] == task]
            if not found:
                cells.append("-")
                continue
            low, high = interval(mean(found), EPISODES)
            cells.append(f"{mean(found):.3f} ({low:.2f} .. {high:.2f})")
        minutes = mean(float(row["cpu_minutes"]) for row in own)
        lines.append([*cells, f"{minutes:.1f}"])
    return lines


def main(
    methods: Annotated[
        str, typer.Option(help="Methods, separated by semicolons; by default all.")
    ] = "",
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path(
        "runs/images"
    ),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train the cells that have no row, and print the table."""
    chosen = methods.split(";") if methods else list(METHODS)
    cells: list[Cell] = [
        (task, name, seed)
        for name in chosen
        for task in METHODS[name].tasks
        for seed in range(METHODS[name].seeds)
    ]
    book = BOOK.at(rows)
    if missing := book.missing(cells, again):
        book.fill(missing, partial(measure, out), jobs)
        table = Table("method", *TASKS, "CPU-minutes")
        for line in summary(read(book.path)):
            table.add_row(*line)
        Console(width=140).print(table)


if __name__ == "__main__":
    typer.run(main)
