"""Print the tables of the ten tasks from the rows of `tasks.py`.

    python scripts/reproduce/task_tables.py --markdown ideal.md --curves curves.png
    python scripts/reproduce/task_tables.py --profile ur5e --markdown ur5e.md

Values are means over the seeds. All seeds play the same episodes, so an interval counts
each episode once. "Blind" is the best controller that does not observe the goal, from
``docs/data/blind.csv``. The script evaluates still, random and sticky. The paper's
column is the row of Table I for RL in its 2D simulator (arXiv 2405.03113), with the
paper's own rules and physics.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from rows import DATA, Row, read
from tasks import EPISODES, THRESHOLDS, Rows, config_of

from marl_airhockey import make_driver
from marl_airhockey.data.benchmark.catalogue import TASKS
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.plots import plot_seed_curves

PAPER = dict.fromkeys(TASKS, 1.0) | {
    "move_block": 0.0,
    "hit_goal": 0.9,
    "hit_goal_velocity": 0.0,
}
"""Success of RL in the paper, by task."""
NONE = "-"
Tables = dict[str, list[Row]]
"""Rows of each table, by its title. The keys of a row are the columns."""


def of(rows: Rows, task: str, profile: str, variant: str = "") -> Rows:
    """Return the rows of a task in a profile and a variant."""
    key = task, profile, variant
    return [r for r in rows if (r["task"], r["profile"], r["variant"]) == key]


def mean(rows: Rows, column: str) -> str:
    """Return the mean of a column; "-" without rows."""
    return f"{np.mean([float(row[column]) for row in rows]):.3f}" if rows else NONE


def baseline(agent: str, task: str, profile: str) -> str:
    """Return the success of a baseline driver."""
    keywords = config_of(task, profile, "", 0).keywords
    driver = make_driver(agent)
    found = evaluate(
        driver, task, episodes=EPISODES, seed=0, name=agent, exact=True, **keywords
    )
    return f"{found.success:.3f}"


def success_of(task: str, profile: str, rows: Rows, blind: Rows) -> Row:
    """Return the row of the table of success."""
    mine = of(rows, task, profile)
    rate = np.mean([float(row["success"]) for row in mine])
    low, high = interval(float(rate), EPISODES)
    first = mean(mine, "first_shot")
    key = task, profile
    unaimed = [r for r in blind if (r["task"], r["profile"]) == key]
    return {
        "task": task,
        "first shot": NONE if float(first) == 0.0 else first,
        "success": mean(mine, "success"),
        "95 % interval": f"{low:.3f} .. {high:.3f}",
        "worst seed": f"{min(float(row['success']) for row in mine):.3f}",
        "blind": mean(unaimed, "success"),
        "random": baseline("random", task, profile),
        "paper's RL": f"{PAPER[task]:.1f}",
    }


def conditions_of(task: str, profile: str, rows: Rows) -> Row:
    """Return the row of the table of other conditions."""
    mine = of(rows, task, profile)
    titles = {"sampled": "sampled", "on pymunk": "pymunk", "with the arm": "arm"}
    row = {title: mean(mine, column) for title, column in titles.items()}
    row |= {"delayed": mean(mine, "delayed")}
    others = sorted({r["variant"] for r in rows if r["profile"] == profile} - {""})
    if others:
        seen = {v: mean(of(rows, task, profile, v), "success") for v in others}
        return {"task": task, **row, **seen}
    skill = {name: baseline(name, task, profile) for name in ("still", "sticky")}
    return {"task": task, **row, **skill}


def cost_of(task: str, profile: str, rows: Rows) -> Row:
    """Return the row of the table of the cost of training."""
    mine = of(rows, task, profile)
    steps = np.mean([float(row["steps"]) for row in mine]) / 1e6
    minutes = np.mean([float(row["cpu_minutes"]) for row in mine])
    row = {"task": task, "M steps": f"{steps:.1f}", "CPU-min": f"{minutes:.1f}"}
    for level in THRESHOLDS:
        times = [r[f"cpu_seconds_to_{level}"] for r in mine]
        value = NONE if "" in times else f"{np.mean([float(t) for t in times]):.0f}"
        row[f"CPU-s to {level}"] = value
    return row


def tables_of(profile: str) -> Tables:
    """Return the tables of a profile, with the tasks that have rows."""
    rows, blind = read(DATA / "tasks.csv"), read(DATA / "blind.csv")
    tasks = [task for task in TASKS if of(rows, task, profile)]
    return {
        "Success": [success_of(task, profile, rows, blind) for task in tasks],
        "Other conditions": [conditions_of(task, profile, rows) for task in tasks],
        "Cost": [cost_of(task, profile, rows) for task in tasks],
    }


def markdown_of(rows: Rows) -> str:
    """Return a table in Markdown."""
    lines = [[*rows[0]], ["---"] * len(rows[0]), *([*row.values()] for row in rows)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def curves_of(points: Rows, task: str, profile: str) -> list[Rows]:
    """Return the curves of a task, one for each seed."""
    mine = of(points, task, profile)
    seeds = sorted({point["seed"] for point in mine})
    return [[p for p in mine if p["seed"] == seed] for seed in seeds]


def main(
    profile: Annotated[
        str, typer.Option(help="Name of the profile, such as ur5e.")
    ] = "ideal",
    markdown: Annotated[
        Path | None, typer.Option(help="Markdown file of the tables.")
    ] = None,
    curves: Annotated[Path | None, typer.Option(help="PNG file of the curves.")] = None,
) -> None:
    """Print the tables, write them, and plot the learning curves."""
    tables = tables_of(profile)
    for title, rows in tables.items():
        shown = Table(*rows[0], title=f"{title}, profile {profile}")
        for row in rows:
            shown.add_row(*row.values())
        Console().print(shown)
    if markdown is not None:
        markdown.write_text("\n".join(map(markdown_of, tables.values())))
    if curves is not None:
        points = read(DATA / "curves.csv")
        title = f"PPO in the profile {profile}, without selection of checkpoints"
        runs = {task: curves_of(points, task, profile) for task in TASKS}
        plot_seed_curves(runs, curves, title)


if __name__ == "__main__":
    typer.run(main)
