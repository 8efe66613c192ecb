"""Print tables or a plot of offline RL, from the rows of `table.py` and the paper.

    python scripts/reproduce/offline_tables.py
    python scripts/reproduce/offline_tables.py --plot docs/images/table.png
    python scripts/reproduce/offline_tables.py --domain paper --plot like_for_like.png

The success of RL is from ``reproduce/tasks.py`` (columns success and arm of
``tasks.csv``), in the lab from ``bench/lab_tasks.py``, and under the paper's rules from
separate rows. Chance is the success of random actions. The paper's figures (arXiv
2405.03113) have its own rules, physics and data.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from marl_airhockey.data.benchmark.content import published
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.sim.render.charts import SOFT, panels, point, save, series

DATA = Path(__file__).parents[2] / "docs" / "data"
"""Folder of the committed rows."""
Paper = tuple[float | None, float | None, float | None]
PAPER: dict[str, dict[str, Paper]] = {
    "2d": {
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
    "robosuite": {
        "reach": (0.9, 0.9, 1.0),
        "reach_velocity": (0.8, 0.9, 1.0),
        "touch": (0.8, 0.8, 1.0),
        "juggle": (0.6, 0.7, 0.9),
        "puck_velocity": (0.6, 0.8, 0.9),
        "hit_goal": (0.1, 0.1, 0.2),
    },
    "lab": {
        "reach": (0.9, 1.0, None),
        "reach_velocity": (0.1, 0.0, None),
        "touch": (0.3, 0.6, None),
        "juggle": (None, None, None),
        "puck_velocity": (0.1, 0.3, None),
    },
}
"""Success of BC, IQL and RL in the paper, by domain and task; None without a figure."""
PAPER["paper"] = PAPER["2d"]
TITLES = {
    "2d": "The ten tasks; the paper's figures have other rules and physics",
    "robosuite": "Six tasks on the arm in MuJoCo",
    "lab": "Five tasks in the virtual lab",
    "paper": "The ten tasks by the rules of the paper's code",
}
"""Titles of plots by domain."""
COLUMNS = {"2d": ("success", 2000), "robosuite": ("arm", 200)}
"""Column of ``tasks.csv`` with the success of RL, and the number of episodes per
seed."""
ALGOS = ("bc", "bc10", "td3_bc", "iql", "rebrac")
EXPERT = "expert"
Row = dict[str, Any]


def read(name: str) -> list[Row]:
    """Return the rows of a CSV file."""
    with (DATA / name).open(newline="") as file:
        return list(csv.DictReader(file))


def success_of(rows: list[Row], *cell: str) -> tuple[float, int] | None:
    """Return the mean success of a domain, tier, task and algorithm, and episodes.

    All seeds play the same episodes, so the number of episodes is that of one seed.
    """
    names = ("domain", "tier", "task", "algo")
    own = [row for row in rows if tuple(row[name] for name in names) == cell]
    if not own:
        return None
    mean = float(np.mean([float(row["success"]) for row in own]))
    return mean, min(int(row["episodes"]) for row in own)


def chance_of(domain: str, task: str, rows: list[Row]) -> float:
    """Return the success of random actions."""
    if domain == "paper":
        found = success_of(rows, domain, EXPERT, task, "random")
        return found[0] if found else float("nan")
    return published()[f"airhockey/{task}/random-v0"].success


def rl_of(domain: str, task: str, rows: list[Row]) -> tuple[float, int] | None:
    """Return the mean success of RL, and the number of episodes."""
    if domain == "paper":
        return success_of(rows, domain, EXPERT, task, "rl")
    if domain == "lab":
        found = [row for row in read("lab_tasks.csv") if row["task"] == task]
        return float(found[0]["lab"].split()[0]), 20
    column, episodes = COLUMNS[domain]
    values = [
        float(row[column])
        for row in read("tasks.csv")
        if (row["task"], row["profile"], row["variant"]) == (task, "ideal", "")
    ]
    return (float(np.mean(values)), episodes) if values else None


def shown(found: tuple[float, int] | None) -> str:
    """Return a success with its 95 % interval as text."""
    if found is None:
        return "-"
    low, high = interval(*found)
    return f"{found[0]:.3f} ({low:.3f} .. {high:.3f})"


def table_of(domain: str, rows: list[Row]) -> list[list[str]]:
    """Return the cells of the table of a domain, header first."""
    found = [["task", "chance", "BC", "IQL", "RL", "paper: BC, IQL, RL"]]
    for task, paper in PAPER[domain].items():
        cells = [success_of(rows, domain, EXPERT, task, a) for a in ("bc", "iql")]
        figures = ", ".join("-" if x is None else f"{x:.1f}" for x in paper)
        chance = f"{chance_of(domain, task, rows):.2f}"
        each = map(shown, (*cells, rl_of(domain, task, rows)))
        found.append([task, chance, *each, figures])
    return found


def tier_table(tier: str, rows: list[Row]) -> list[list[str]]:
    """Return the cells of the table of a tier in 2d, header first."""
    tasks = dict.fromkeys(row["task"] for row in rows if row["tier"] == tier)
    return [
        ["task", *ALGOS],
        *(
            [t, *(shown(success_of(rows, "2d", tier, t, a)) for a in ALGOS)]
            for t in tasks
        ),
    ]


def tables_of(rows: list[Row]) -> dict[str, list[list[str]]]:
    """Return the tables of the domains and tiers that have rows, by title."""
    domains = dict.fromkeys(row["domain"] for row in rows)
    tiers = dict.fromkeys(row["tier"] for row in rows if row["tier"] != EXPERT)
    return {
        **{domain: table_of(domain, rows) for domain in domains},
        **{tier: tier_table(tier, rows) for tier in tiers},
    }


def seeds_of(domain: str, algo: str, rows: list[Row]) -> str:
    """Return the number of seeds of an algorithm in a task as text."""
    cell = {"domain": domain, "tier": EXPERT, "algo": algo}
    if algo == "rl" and domain == "lab":
        return "1 seed"
    if algo == "rl" and domain in COLUMNS:
        rows, cell = read("tasks.csv"), {"profile": "ideal", "variant": ""}
    own = [r["task"] for r in rows if all(r[name] == cell[name] for name in cell)]
    counts = [own.count(task) for task in PAPER[domain]]
    few, many = min(counts), max(counts)
    return f"{few} seed{'s' * (few > 1)}" if few == many else f"{few} to {many} seeds"


def plot(rows: list[Row], path: Path, domain: str) -> None:
    """Plot our success with intervals, the paper's figures, and chance."""
    tasks = list(PAPER[domain])
    figure, grid = panels(size=(9, 0.5 * len(tasks) + 1.7))
    axes = grid[0, 0]
    for k, name in enumerate(("bc", "iql", "rl")):
        look, shift = series(k), 0.24 * (k - 1)
        label = f"{name.upper()}, {seeds_of(domain, name, rows)}"
        for height, task in enumerate(tasks):
            found = (
                rl_of(domain, task, rows)
                if name == "rl"
                else success_of(rows, domain, EXPERT, task, name)
            )
            if found is not None:
                point(axes, height + shift, found[0], interval(*found), look, label)
            paper = PAPER[domain][task][k]
            if paper is not None:
                axes.plot(
                    *([paper], [height + shift], look.marker),
                    color=look.colour,
                    markerfacecolor="none",
                    markersize=9,
                    label=f"{name.upper()}, the paper",
                )
    for height, task in enumerate(tasks):
        chance = chance_of(domain, task, rows)
        axes.plot([chance], [height], "x", color=SOFT, label="chance")
    axes.set_yticks(range(len(tasks)), [task.replace("_", " ") for task in tasks])
    axes.set(ylim=(len(tasks) - 0.5, -0.6), xlim=(-0.03, 1.03))
    axes.set_xlabel("success; bars are 95 % intervals over episodes")
    save(figure, path, TITLES[domain])


def main(
    picture: Annotated[
        Path | None, typer.Option("--plot", help="PNG file of the plot.")
    ] = None,
    domain: Annotated[str, typer.Option(help="Domain of the plot.")] = "2d",
) -> None:
    """Print the tables in Markdown, or write the plot."""
    rows = read("offline.csv")
    if picture is not None:
        plot(rows, picture, domain)
        return
    for title, (header, *lines) in tables_of(rows).items():
        print(f"\n{title}\n")
        for cells in (header, ["---"] * len(header), *lines):
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    typer.run(main)
