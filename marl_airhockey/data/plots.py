"""Plots of trajectories on the table and over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap

from marl_airhockey.data.extract import Trajectories
from marl_airhockey.sim.contracts.palette import LIGHT
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import TABLES, Table
from marl_airhockey.sim.render.charts import PALE, SOFT, panels, save, series
from marl_airhockey.types import Array

PUCK, PADDLE = series(1), series(0)
"""Looks of the puck and of a paddle in plots."""


def plot_table(axes: Axes, table: Table, scene: Scene | None = None) -> None:
    """Plot the rails of a table, and the goals of a scene in the colours of seats."""
    corners = np.asarray(table.vertices)
    axes.fill(*corners.T, facecolor="none", edgecolor=LIGHT["rail"], linewidth=3)
    if len(corners) == 4:
        axes.axvline(0, color=PALE, linewidth=1)
    if scene is not None:
        _plot_goals(axes, scene)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m")


def _plot_goals(axes: Axes, scene: Scene) -> None:
    sides = [seat.side for seat in scene.seats]
    for line in scene.goal_lines:
        if line.width is not None:
            owner = sides.index(line.side) if line.side in sides else 0
            ends, colour = scene.opening(line), series(owner).colour
            axes.plot(*ends.T, color=colour, linewidth=5, solid_capstyle="butt")


def plot_trajectories(found: Trajectories, path: Path) -> None:
    """Write a PNG of both trajectories, on the table and as x and y over time.

    Colours on the table show the time. Gaps, in which a body was not detected, are
    dotted on the table and grey over time.
    """
    figure, ((field,), *rows) = panels(3, 1, (8, 8.4), heights=(2.4, 1, 1))
    plot_table(field, TABLES[found.table])
    for places, colours, name in (
        (found.puck, "Oranges", "puck"),
        (found.paddle, "Blues", "paddle"),
    ):
        lines = _path(field, found.time, places, colours, name)
        if lines is not None:
            label = f"time of the {name}, s"
            figure.colorbar(lines, ax=field, label=label, shrink=0.8, pad=0.01)
    for (axes,), axis in zip(rows, range(2), strict=True):
        for places, look, name in (
            (found.puck, PUCK, "puck"),
            (found.paddle, PADDLE, "paddle"),
        ):
            line = {"color": look.colour, "linestyle": look.line}
            axes.plot(found.time, places[:, axis], label=name, **line)
        for begin, end in found.gaps(found.puck):
            style = {"color": SOFT, "alpha": 0.25, "linewidth": 0}
            axes.axvspan(begin, end, label="puck not detected", **style)
        axes.set_ylabel(f"{'xy'[axis]}, m")
    rows[-1][0].set_xlabel("time, s")
    share = f"puck in {np.isfinite(found.puck[:, 0]).mean():.0%}"
    paddle = f"paddle in {np.isfinite(found.paddle[:, 0]).mean():.0%}"
    save(figure, path, f"n = {len(found.time)} frames: {share}, {paddle}")


def _path(
    axes: Axes, time: Array, places: Array, colours: str, name: str
) -> LineCollection | None:
    """Plot a trajectory, darker at later times and dotted across its gaps."""
    seen = np.isfinite(places[:, 0])
    if seen.sum() < 2:
        return None
    axes.plot(*places[seen].T, ":", color=SOFT, linewidth=0.8)
    pieces = np.stack([places[:-1], places[1:]], 1)
    whole = np.isfinite(pieces).all((1, 2))
    # The palest colours are invisible on white.
    shades = ListedColormap(colormaps[colours](np.linspace(0.3, 1.0, 256)))
    lines = LineCollection(list(pieces[whole]), cmap=shades, linewidths=2)
    lines.set_array(time[:-1][whole])
    axes.add_collection(lines)
    axes.plot(*places[seen][-1], "o", color=lines.cmap(1.0), markersize=5)
    axes.annotate(name, places[seen][0], xytext=(4, 4), textcoords="offset points")
    return lines
