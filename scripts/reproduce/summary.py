"""Summarize success over the ten tasks: interquartile means and performance profiles.

    python scripts/reproduce/summary.py --out docs/images/profile.png

The rows are those of ``docs/data/tasks.csv`` and ``docs/data/offline.csv``, and the
success of random actions is that of the datasets. Intervals are stratified bootstraps
over the seeds. A method with fewer than three seeds in a task has no interval.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rows import DATA, Row, read

from marl_airhockey.data.benchmark.catalogue import TASKS
from marl_airhockey.data.benchmark.content import published
from marl_airhockey.evaluation.stats import iqm, over_tasks, performance_profile
from marl_airhockey.sim.render.charts import panels, point, save, series
from marl_airhockey.types import Array

LEVELS = 1.0 - np.geomspace(1.0, 5e-4, 300)
"""Levels of success, denser near 1."""
TICKS = (0.0, 0.5, 0.9, 0.99, 0.999)
FEWEST = 3
"""Smallest number of seeds in each task for an interval."""
Runs = list[Array]
"""Success of the seeds of each task."""


def runs_of(rows: list[Row], **cell: str) -> Runs:
    """Return the success of the rows whose columns have some values."""
    own = [r for r in rows if all(r[name] == value for name, value in cell.items())]
    return [
        np.array([float(r["success"]) for r in own if r["task"] == t]) for t in TASKS
    ]


def methods() -> dict[str, Runs]:
    """Return the runs of each method, by name."""
    ours, offline = read(DATA / "tasks.csv"), read(DATA / "offline.csv")
    cell = {"domain": "2d", "tier": "expert"}
    known = published()
    chance = [known[f"airhockey/{task}/random-v0"].success for task in TASKS]
    return {
        "PPO": runs_of(ours, profile="ideal", variant=""),
        "IQL": runs_of(offline, algo="iql", **cell),
        "BC": runs_of(offline, algo="bc", **cell),
        "PPO, profile ur5e": runs_of(ours, profile="ur5e", variant=""),
        "random actions": [np.array([success]) for success in chance],
    }


def stretched(level: Array) -> Array:
    """Return the position of a level of success on an axis."""
    return np.asarray(-np.log10(np.maximum(1.0 - np.asarray(level), 1e-6)))


def compressed(position: Array) -> Array:
    """Return the level of success at a position on an axis."""
    return np.asarray(1.0 - 10.0 ** -np.asarray(position))


def main(
    out: Annotated[Path, typer.Option(help="PNG file.")] = Path(
        "docs/images/profile.png"
    ),
) -> None:
    """Print the interquartile means, and plot them with the profiles."""
    found = methods()
    figure, ((left, right),) = panels(1, 2, (10, 4.4), widths=(1, 1.5))
    names = []
    for k, (name, runs) in enumerate(found.items()):
        look, counts = series(k), sorted(set(map(len, runs)))
        seeds = f"n = {' to '.join(map(str, (dict.fromkeys((counts[0], counts[-1])))))}"
        middle, *ends = over_tasks(runs, iqm)
        share, *band = over_tasks(
            runs, lambda values: performance_profile(values, LEVELS)
        )
        shown = counts[0] >= FEWEST
        interval = (float(ends[0]), float(ends[1])) if shown else (np.nan, np.nan)
        point(left, k, float(middle), interval, look)
        style = {"color": look.colour, "linestyle": look.line, "label": name}
        right.plot(LEVELS, share, **style)
        if shown:
            right.fill_between(LEVELS, *band, color=look.colour, alpha=0.2, linewidth=0)
        low, high = interval
        text = f"{middle:.3f} ({low:.3f} .. {high:.3f})" if shown else f"{middle:.3f}"
        names.append(f"{name}, {seeds}\n{text}")
        print(f"{name}, {seeds}: {text}")
    for axes in (left, right):
        axes.set_xscale("function", functions=(stretched, compressed))
        axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
        axes.set_xlim(-0.2, LEVELS[-1])
    left.set_yticks(range(len(names)), names)
    left.set(ylim=(len(names) - 0.5, -0.5), xlabel="interquartile mean of success")
    right.set(ylim=(-0.03, 1.03), xlabel="level of success")
    right.set_ylabel("share of runs and tasks above the level")
    what = "bars and bands are 95 % intervals"
    save(figure, out, f"{len(TASKS)} tasks, n seeds of each task; {what}")


if __name__ == "__main__":
    typer.run(main)
