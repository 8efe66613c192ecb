"""Plot of a report."""

from __future__ import annotations

import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.play.measures import Player
from marl_airhockey.play.report import Report
from marl_airhockey.sim.render.charts import DPI, INK, INKS, save, tidy

LINE = 0.34
"""Height of the line of a player, inches."""
NAME = 26
"""Largest number of characters in a line of a player's name."""
PANELS = (
    ("delays", "round trip of the page, ms"),
    ("shot_speeds", "speed of shots, m/s"),
    ("shot_placements", "offset at which shots\nwould arrive, m"),
)
"""Fields of `Player` in the plot, and their labels."""


def plot_report(report: Report, path: Path) -> None:
    """Write a PNG with a line for each player.

    The plot shows the score with its 95 % interval, and medians and quartiles of round
    trips and of speed and placement of shots.
    """
    rows = report.rows()[::-1]
    players = [report.players[row["player"]] for row in rows]
    figure, grid = plt.subplots(
        *(1, 1 + len(PANELS)),
        figsize=(11, LINE * len(rows) + 1.3),
        dpi=DPI,
        layout="constrained",
        sharey=True,
    )
    for k, (row, player) in enumerate(zip(rows, players, strict=True)):
        if player.games:
            _line(grid[0], k, player, *row["score"])
        for axes, (name, _) in zip(grid[1:], PANELS, strict=True):
            values = getattr(player, name)
            if len(values):
                low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
                _line(axes, k, player, middle, low, high)
    names = [textwrap.fill(row["player"], NAME) for row in rows]
    grid[0].set_yticks(range(len(rows)), names)
    grid[0].axvline(0.5, color=INKS[0], linestyle=":", linewidth=1)
    grid[0].set(xlim=(-0.02, 1.02), xlabel="score: win + draw / 2\n(95 % interval)")
    for axes, (name, label) in zip(grid[1:], PANELS, strict=True):
        axes.set_xlabel(f"{label}\n(median, quartiles)")
        if not any(len(getattr(player, name)) for player in players):
            axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center")
    for axes in grid:
        tidy(axes, legend=None)
    save(figure, path)


def _line(
    axes: Axes, k: int, player: Player, middle: float, low: float, high: float
) -> None:
    """Plot a value and its range in the line of a player."""
    ink = INK if player.person else INKS[0]
    axes.plot([low, high], [k, k], color=ink, linewidth=2)
    axes.plot(middle, k, "o", color=ink)
