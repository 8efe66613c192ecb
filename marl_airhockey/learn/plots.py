"""Plots of training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.evaluation.stats import bootstrap, iqm
from marl_airhockey.sim.render.charts import SOFT, Series, panels, save, series
from marl_airhockey.types import Array

BAND = "interquartile mean over n seeds, and its 95 % interval"
TARGET = 0.95
"""Success of the dotted line."""


def plot_learning_curve(
    rows: Sequence[Mapping[str, str]],
    floors: Mapping[str, float],
    title: str,
    path: Path,
) -> None:
    """Plot success of a run against CPU-seconds of training, with baselines as lines.

    Args:
        rows: Rows of ``evaluations.csv``.
        floors: Success of other drivers, by name.
        title: Title of the plot.
        path: Path of the PNG file.
    """
    figure, grid = panels()
    axes = grid[0, 0]
    # A baseline is narrower than the one before, so that equal ones are both visible.
    for k, (name, level) in enumerate(floors.items()):
        wide, (colour, _, line) = 1.5 * (len(floors) - k) + 0.5, series(k + 2)
        style = {"color": colour, "linestyle": line, "linewidth": wide, "alpha": 0.8}
        axes.axhline(level, label=f"{name}, not trained", **style)
    cpu = [0.0, *(float(row["learning_cpu_seconds"]) for row in rows)]
    for k, (name, label) in enumerate(
        (("success_sampled", "learned, sampled actions"), ("success", "learned, mean"))
    ):
        share, look = [0.0, *(float(row[name]) for row in rows)], series(1 - k)
        axes.plot(cpu, share, markersize=4, label=label, **look.style)
    axes.set(
        xlabel="CPU-seconds of learning, without evaluations",
        ylabel="success",
        ylim=(-0.03, 1.03),
        xlim=(0, None),
    )
    save(figure, path, f"{title.replace('_', ' ')}: one training run")


def plot_seed_curves(
    runs: Mapping[str, Sequence[Sequence[Mapping[str, str]]]],
    path: Path,
    title: str = "",
) -> None:
    """Plot success against CPU-seconds, with one panel per task drawn by `plot_iqm`.

    Args:
        runs: Rows of each seed, by task, with ``cpu_seconds`` of learning and
            ``success``.
        path: Path of the PNG file.
        title: Title of the plot.
    """
    across = min(5, len(runs))
    down = -(-len(runs) // across)
    size = 2.1 * across + 0.4, 2.0 * down + 0.7
    figure, grid = panels(down, across, size, share_x=True, share_y=True)
    for axes in grid.flat[len(runs) :]:
        axes.set_visible(False)
    for axes, (name, seeds) in zip(grid.flat, runs.items(), strict=False):
        length = min(len(rows) for rows in seeds)
        share = np.array(
            [[float(row["success"]) for row in rows[:length]] for rows in seeds]
        )
        cpu = np.mean(
            [[float(row["cpu_seconds"]) for row in rows[:length]] for rows in seeds], 0
        )
        label = f"success of {TARGET}"
        axes.axhline(TARGET, color=SOFT, linestyle=":", linewidth=1.2, label=label)
        plot_iqm(axes, cpu, share, series(0), BAND)
        axes.set_title(f"{name.replace('_', ' ')}, n = {len(seeds)}", fontsize="small")
        axes.set(ylim=(-0.03, 1.03), xscale="log")
        axes.xaxis.set_major_formatter("{x:g}")
    middle = grid[-1, (across - 1) // 2]
    middle.set_xlabel("CPU-seconds of learning, without evaluations")
    for axes in grid[:, 0]:
        axes.set_ylabel("success")
    save(figure, path, title)


def plot_iqm(axes: Axes, x: Array, runs: Array, look: Series, label: str = "") -> None:
    """Plot the interquartile mean of runs (runs, points) and its 95 % interval."""
    points = np.asarray(runs).T
    middle = [iqm(point) for point in points]
    low, high = np.transpose([bootstrap(point, resamples=400) for point in points])
    axes.fill_between(x, low, high, color=look.colour, alpha=0.18, linewidth=0)
    axes.plot(x, middle, markersize=3, label=label, **look.style)
