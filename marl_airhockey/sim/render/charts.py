"""Common style of all plots with matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK, PALE = "#0072B2", "#86b8d8"
INKS = ("#8a8f98", "#b06a00", "#00805c")
"""Colours of lines in addition to the main line."""
DPI = 130


def tidy(axes: Axes, legend: Literal["best", "center right"] | None = "best") -> None:
    """Remove two spines, and add a grid and a legend at ``legend``, None for none."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    if legend is not None:
        axes.legend(frameon=False, loc=legend)


def save(figure: Figure, path: Path) -> None:
    """Write a figure to a file, create its folder, and close the figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)
