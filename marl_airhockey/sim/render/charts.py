"""Common style of all plots with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from marl_airhockey.sim.contracts.palette import LIGHT, SEATS
from marl_airhockey.types import Array

INK, SOFT, PALE = LIGHT["ink"], LIGHT["soft"], LIGHT["print"]
DPI = 130
MARKERS = "osD^vP"
LINES = ("-", "--", "-.", ":", (0, (7, 2)), (0, (5, 1, 1, 1, 1, 1)))
STYLE: Any = {
    "axes.prop_cycle": cycler(color=SEATS),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.alpha": 0.25,
    "axes.titlesize": "medium",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "text.color": INK,
}
CHARACTERS = 12
"""Number of characters of a legend per inch."""


class Series(NamedTuple):
    """Look of a series of data, which differs from all others also without colour."""

    colour: str
    marker: str
    line: Any
    """Line style of matplotlib."""

    @property
    def style(self) -> dict[str, Any]:
        """Keywords of `Axes.plot`."""
        return {"color": self.colour, "marker": self.marker, "linestyle": self.line}


def series(number: int) -> Series:
    """Return the look of a series, which is different for 36 numbers."""
    k, shift = number % len(SEATS), number // len(SEATS)
    other = (k + shift) % len(SEATS)
    return Series(SEATS[k], MARKERS[other], LINES[other])


def panels(
    rows: int = 1,
    columns: int = 1,
    size: tuple[float, float] = (7.2, 4.2),
    *,
    share_x: bool = False,
    share_y: bool = False,
    widths: Sequence[float] | None = None,
    heights: Sequence[float] | None = None,
) -> tuple[Figure, Array]:
    """Return a figure and its panels (rows, columns), with the common style.

    Args:
        rows: Number of rows.
        columns: Number of columns.
        size: Width and height, inches.
        share_x: True if all panels have the same x axis.
        share_y: True if all panels have the same y axis.
        widths: Relative widths of the columns, None for equal ones.
        heights: Relative heights of the rows, None for equal ones.
    """
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(
            *(rows, columns),
            figsize=size,
            dpi=DPI,
            layout="constrained",
            squeeze=False,
            sharex=share_x,
            sharey=share_y,
            width_ratios=widths,
            height_ratios=heights,
        )
    return figure, grid


def point(
    axes: Axes,
    height: float,
    value: float,
    ends: tuple[float, float],
    look: Series,
    label: str = "",
) -> None:
    """Plot a value and its interval at a height; ends that are nan are not drawn."""
    # A butt cap does not extend beyond the interval, and thus beyond a scale.
    axes.plot(
        *(ends, [height, height]),
        color=look.colour,
        linewidth=2,
        solid_capstyle="butt",
    )
    axes.plot(
        *(value, height),
        color=look.colour,
        marker=look.marker,
        markersize=5,
        linestyle="none",
        label=label,
    )


def save(figure: Figure, path: Path, title: str = "", legend: bool = True) -> None:
    """Write a figure with a title, and with one legend of all panels below them.

    The folder of the file is created, and the figure is closed.
    """
    if title:
        figure.suptitle(title, fontsize="large")
    found: dict[str, Any] = {}
    for axes in figure.axes if legend else ():
        handles, labels = axes.get_legend_handles_labels()
        found |= dict(zip(labels, handles, strict=True))
    if found:
        longest = max(map(len, found)) + 7
        fitting = int(figure.get_figwidth() * CHARACTERS / longest)
        figure.legend(
            *(list(found.values()), list(found)),
            loc="outside lower center",
            ncols=int(np.clip(fitting, 1, len(found))),
            frameon=False,
            fontsize="small",
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)
