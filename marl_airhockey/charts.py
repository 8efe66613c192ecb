"""How all plots look."""

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
"""Of what stands beside the main line."""
DPI = 130


def tidy(axes: Axes, legend: Literal["best", "center right"] | None = "best") -> None:
    """Take off what says nothing; ``legend`` is its place, or None."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    if legend is not None:
        axes.legend(frameon=False, loc=legend)


def save(figure: Figure, path: Path) -> None:
    """Write a PNG and let go of the figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)
