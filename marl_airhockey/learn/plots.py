"""Plots of training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.evaluation.stats import bootstrap, iqm
from marl_airhockey.sim.render.charts import DPI, INK, INKS, PALE, save, tidy
from marl_airhockey.types import Array


def plot_learning_curve(
    rows: Sequence[Mapping[str, str]],
    floors: Mapping[str, float],
    title: str,
    path: Path,
) -> None:
    """Plot success against CPU-seconds of training, with baselines as lines.

    Args:
        rows: Rows of ``evaluations.csv``.
        floors: Success of other drivers, by name.
        title: Title of the plot.
        path: Path of the PNG file.
    """
    figure, axes = plt.subplots(figsize=(7.2, 4.2), dpi=DPI, layout="constrained")
    cpu = [0.0, *(float(row["learning_cpu_seconds"]) for row in rows)]
    for name, label, ink in (
        ("success", "learned, mean action", INK),
        ("success_sampled", "learned, sampled", PALE),
    ):
        share = [0.0, *(float(row[name]) for row in rows)]
        axes.plot(cpu, share, color=ink, marker="o", markersize=4, label=label)
    for (name, level), ink in zip(floors.items(), INKS, strict=False):
        axes.axhline(level, color=ink, linestyle="--", linewidth=1.2, label=name)
    axes.set(
        xlabel="CPU-seconds of learning, without evaluations",
        ylabel="success",
        ylim=(-0.03, 1.03),
        xlim=(0, None),
        title=title.replace("_", " "),
    )
    tidy(axes, "center right")
    save(figure, path)


def plot_seed_curves(
    runs: Mapping[str, Sequence[Sequence[Mapping[str, str]]]], path: Path
) -> None:
    """Plot success against CPU-seconds, with one panel per task drawn by `plot_iqm`.

    Args:
        runs: Rows of each seed, by task, with ``cpu_seconds`` of learning and
            ``success``.
        path: Path of the PNG file.
    """
    across = min(5, len(runs))
    down = -(-len(runs) // across)
    figure, grid = plt.subplots(
        down,
        across,
        figsize=(2.6 * across, 2.2 * down),
        dpi=DPI,
        layout="constrained",
        squeeze=False,
        sharey=True,
    )
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
        plot_iqm(axes, cpu, share, INK)
        axes.axhline(0.95, color=INKS[0], linestyle=":", linewidth=1)
        axes.set(title=name.replace("_", " "), ylim=(-0.03, 1.03), xlim=(0, None))
        tidy(axes, legend=None)
    figure.supxlabel("CPU-seconds of learning, without evaluations")
    figure.supylabel("success")
    save(figure, path)


def plot_iqm(axes: Axes, x: Array, runs: Array, ink: str, label: str = "") -> None:
    """Plot the interquartile mean of runs (runs, points) and its 95 % interval."""
    points = np.asarray(runs).T
    middle = [iqm(point) for point in points]
    low, high = np.transpose([bootstrap(point, resamples=400) for point in points])
    axes.fill_between(x, low, high, color=ink, alpha=0.18, linewidth=0)
    axes.plot(x, middle, color=ink, label=label)
