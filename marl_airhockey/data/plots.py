"""Plots of trajectories on the table and over time."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from marl_airhockey.data.extract import Trajectories
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.sim.render.charts import DPI, INK, INKS, save, tidy
from marl_airhockey.types import Array


def plot_trajectories(found: Trajectories, path: Path) -> None:
    """Write a PNG of both trajectories, on the table and as x and y over time.

    Colours on the table show the time. Gaps, in which a body was not detected, are
    dotted on the table and grey over time.
    """
    figure, (field, *rows) = plt.subplots(
        3, 1, figsize=(8, 8), dpi=DPI, layout="constrained", height_ratios=(2.4, 1, 1)
    )
    corners = np.asarray(TABLES[found.table].vertices)
    field.fill(*corners.T, facecolor="#f4f6f8", edgecolor=INKS[0], linewidth=2)
    for places, colours, name in (
        (found.puck, "autumn_r", "puck"),
        (found.paddle, "winter_r", "paddle"),
    ):
        _path(field, found.time, places, colours, name)
    field.set_aspect("equal")
    field.set(xlabel="x, m", ylabel="y, m")
    tidy(field, None)
    for axes, axis in zip(rows, range(2), strict=True):
        axes.plot(found.time, found.puck[:, axis], color="#d04010", label="puck")
        axes.plot(found.time, found.paddle[:, axis], color=INK, label="paddle")
        for begin, end in found.gaps(found.puck):
            axes.axvspan(begin, end, color=INKS[0], alpha=0.25, linewidth=0)
        axes.set_ylabel(f"{'xy'[axis]}, m")
        tidy(axes, "best" if axis == 0 else None)
    rows[-1].set_xlabel("time, s; grey: puck not detected")
    save(figure, path)


def _path(axes: Axes, time: Array, places: Array, colours: str, name: str) -> None:
    """Plot a trajectory, darker at later times and dotted across its gaps."""
    seen = np.isfinite(places[:, 0])
    if seen.sum() < 2:
        return
    axes.plot(*places[seen].T, ":", color=INKS[0], linewidth=0.8)
    pieces = np.stack([places[:-1], places[1:]], 1)
    whole = np.isfinite(pieces).all((1, 2))
    lines = LineCollection(list(pieces[whole]), cmap=colours, linewidths=2)
    lines.set_array(time[:-1][whole])
    axes.add_collection(lines)
    axes.plot(*places[seen][-1], "o", color=lines.cmap(1.0), markersize=5)
    axes.annotate(name, places[seen][0], xytext=(4, 4), textcoords="offset points")
