"""Common look of all plots, by matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from marl_airhockey.evaluation.stats import bootstrap, iqm
from marl_airhockey.types import Array

INK, PALE = "#0072B2", "#86b8d8"
INKS = ("#8a8f98", "#b06a00", "#00805c")
"""Colours of what is drawn beside the main line"""
DPI = 130


def tidy(axes: Axes, legend: Literal["best", "center right"] | None = "best") -> None:
    """Remove needless spines, add a grid, and a legend at ``legend`` unless None."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    if legend is not None:
        axes.legend(frameon=False, loc=legend)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, make its folder, and close the figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)


def plot_iqm(axes: Axes, x: Array, runs: Array, ink: str, label: str = "") -> None:
    """Draw the interquartile mean of runs (runs, points) and its 95 % interval."""
    points = np.asarray(runs).T
    middle = [iqm(point) for point in points]
    low, high = np.transpose([bootstrap(point, resamples=400) for point in points])
    axes.fill_between(x, low, high, color=ink, alpha=0.18, linewidth=0)
    axes.plot(x, middle, color=ink, label=label)
