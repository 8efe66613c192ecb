"""Measure what latency costs, and what methods regain; print a table and plot curves.

    python scripts/reproduce/delay.py --jobs 2

In the tasks, the latency is that of the sensed puck. A method is trained with three
seeds. "none" is trained without latency. The other methods are trained with a latency
that is sampled for each episode, and observe the sensed state, a filter's prediction
for now, or a history of positions and of own actions. In the suites of set pieces,
known drivers play with other reaction times than the usual 0.15 s. A run or a row that
exists is not computed again.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from games import folder_of, train_all
from rich.console import Console
from rich.table import Table
from rows import DATA, Again, Book, Cell, Row, RowsFile, read

import marl_airhockey as ah
from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate
from marl_airhockey.learn.plots import plot_iqm
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.render.charts import panels, save, series

LONGEST = 0.25
"""Longest latency in training, s."""
SAMPLED = {"training_physics": {"observation_delay": [0.0, LONGEST]}}
METHODS: dict[str, dict[str, Any]] = {
    "none": {},
    "random latency": SAMPLED,
    "filter": {**SAMPLED, "observe": "estimate"},
    "history": {**SAMPLED, "observe": "history"},
}
"""Settings by method."""
TASKS = ("juggle", "hit_goal")
LATENCIES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)
SUITES, PLAYERS = ("defence-v1", "played-v1"), ("zoo/duel", "goalkeeper", "allround")
REACTIONS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
EPISODES = 500
FIELDS = ("task", "method", "seed", "latency", "success")
IMAGE = DATA.parent / "images" / "delay.png"
PROFILES = ("gantry", "ur5e")
"""Profiles whose latencies are marked in the plot."""


def place(row: Row) -> tuple[object, ...]:
    """Return the sort key of a row."""
    methods = (*METHODS, *PLAYERS)
    task = (*TASKS, *SUITES).index(row["task"])
    seed = int(row["seed"] or 0)
    return task, methods.index(row["method"]), seed, float(row["latency"])


BOOK = Book(DATA / "delay.csv", FIELDS[:4], place)


def cells_of(seeds: int) -> list[Cell]:
    """Return the cells: tasks with methods and seeds, and suites with players."""
    trained = [(t, m, s) for t in TASKS for m in METHODS for s in range(seeds)]
    known = [(suite, player, "") for suite in SUITES for player in PLAYERS]
    cells: list[Cell] = [(*cell, x) for cell in trained for x in LATENCIES]
    return cells + [(*cell, x) for cell in known for x in REACTIONS]


def run_of(out: Path, task: str, method: str, seed: int) -> Path:
    """Return the folder of a run."""
    return folder_of(out, f"{task}-{method.replace(' ', '-')}", seed)


def measure(out: Path, task: str, method: str, seed: Any, latency: float) -> Row:
    """Return the row of a method with a latency, s."""
    if task in SUITES:
        suite = ah.load_suite(task, reaction=latency)
        success = float(suite.play(method).solved.mean())
    else:
        policy = ah.load_policy(run_of(out, task, method, seed) / "last.npz")
        success = evaluate(
            policy,
            task,
            episodes=EPISODES,
            seed=TEST_SEED,
            exact=True,
            observe=METHODS[method].get("observe", "velocity"),
            physics={"observation_delay": latency},
        ).success
    values = task, method, seed, latency, round(success, 4)
    return dict(zip(FIELDS, values, strict=True))


def groups(rows: list[Row]) -> dict[tuple[str, str], np.ndarray]:
    """Return success (seeds, latencies) by task and method."""
    found: dict[tuple[str, str], dict[str, list[float]]] = {}
    for row in rows:
        mine = found.setdefault((row["task"], row["method"]), {})
        mine.setdefault(row["seed"], []).append(float(row["success"]))
    return {key: np.array(list(mine.values())) for key, mine in found.items()}


def summary(rows: list[Row]) -> list[list[str]]:
    """Return the lines of the table: means over seeds by latency."""
    lines = []
    for (task, method), values in groups(rows).items():
        axis = REACTIONS if task in SUITES else LATENCIES
        shown = [f"{axis[k]:g} s: {x:.2f}" for k, x in enumerate(values.mean(0))]
        lines.append([task, method, str(len(values)), *shown])
    return lines


def plot(rows: list[Row], path: Path) -> None:
    """Plot success over latency, one panel for each task and suite."""
    known = groups(rows)
    tasks = list(dict.fromkeys(task for task, _ in known))
    figure, grid = panels(1, len(tasks), (2.6 * len(tasks) + 0.4, 3.2))
    for axes, task in zip(grid[0], tasks, strict=True):
        mine = {m: values for (t, m), values in known.items() if t == task}
        axis = 1000 * np.array(REACTIONS if task in SUITES else LATENCIES)
        for k, (method, values) in enumerate(mine.items()):
            steps = np.tile(axis, (len(values), 1))
            plot_iqm(axes, steps.mean(0), values, series(k), method)
        for profile in PROFILES if task in TASKS else ():
            delay = Physics({}, profile, None).highest("observation_delay")
            axes.axvline(1000 * delay, color="0.6", linewidth=0.8, linestyle=":")
            axes.text(1000 * delay, 0.02, profile, rotation=90, fontsize="x-small")
        axes.set_title(task, fontsize="small")
        axes.set(xlabel="latency, ms", ylim=(-0.03, 1.03))
    save(figure, path)


def main(
    seeds: Annotated[int, typer.Option(help="Number of seeds, from 0.")] = 3,
    jobs: Annotated[int, typer.Option(help="Number of processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs/delay"),
    again: Again = False,
    rows: RowsFile = None,
) -> None:
    """Train what is missing, measure the cells that have no row, print the table."""
    book = BOOK.at(rows)
    missing = book.missing(cells_of(seeds), again)
    if not missing:
        return
    runs = dict.fromkeys(cell[:3] for cell in missing if cell[0] in TASKS)
    tasks = [(run_of(out, *r), r[0], {**METHODS[r[1]], "seed": r[2]}) for r in runs]
    for _ in train_all(tasks, jobs):
        pass
    book.fill(missing, partial(measure, out), jobs)
    table = Table("task", "method", "n", *(["success"] + [""] * 5))
    for line in summary(read(book.path)):
        table.add_row(*line)
    Console(width=140).print(table)
    plot(read(book.path), book.path.with_suffix(".png") if rows else IMAGE)


if __name__ == "__main__":
    typer.run(main)
