"""Plot of a report."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np

from marl_airhockey.evaluation.stats import FEWEST_GROUPS
from marl_airhockey.play.report import Report
from marl_airhockey.sim.render.charts import SOFT, panels, point, save, series

MOST = 40
"""Largest number of players in the plot."""
LINE = 0.16
"""Height of a line of text, inches."""
NAME = 26
"""Largest number of characters in a line of a player's name."""
PANELS = (
    ("delays", "round trip of the page, ms"),
    ("shot_speeds", "speed of shots, m/s"),
    ("shot_placements", "offset at which shots\nwould arrive, m"),
)
"""Fields of `Player` in the plot, and their labels."""


def plot_report(report: Report, path: Path) -> None:
    """Write a PNG with a line for each of the players with the most games.

    The plot shows the score with its 95 % interval, and medians and quartiles of round
    trips and of speed and placement of shots.
    """
    every = report.rows()
    rows = every[:MOST][::-1]
    names = [
        f"{textwrap.fill(row['player'], NAME)}\nn = {row['games']} games"
        for row in rows
    ]
    lines = 1 + max((name.count("\n") for name in names), default=1)
    size = 11, (lines * LINE + 0.1) * len(rows) + 1.6
    figure, (grid,) = panels(1, 1 + len(PANELS), size, share_y=True)
    for k, row in enumerate(rows):
        player, look = report.players[row["player"]], series(0 if row["person"] else 1)
        label = "person" if row["person"] else "driver"
        if player.games:
            score, *ends = row["score"]
            point(grid[0], k, score, ends, look, label)
        for axes, (name, _) in zip(grid[1:], PANELS, strict=True):
            values = getattr(player, name)
            if len(values):
                low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
                point(axes, k, middle, (low, high), look, label)
    grid[0].set_yticks(range(len(rows)), names, fontsize="small")
    grid[0].axvline(0.5, color=SOFT, linestyle=":", linewidth=1)
    scale = f"score: win + draw / 2\n(95 % interval from n = {FEWEST_GROUPS})"
    grid[0].set(xlim=(-0.02, 1.02), ylim=(-0.6, len(rows) - 0.4), xlabel=scale)
    for axes, (name, label) in zip(grid[1:], PANELS, strict=True):
        axes.set_xlabel(f"{label}\n(median, quartiles)")
        if not any(len(getattr(report.players[row["player"]], name)) for row in rows):
            axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center")
    shown = f"{len(rows)} of {len(every)} players" + (
        ", those with the most games" if len(rows) < len(every) else ""
    )
    save(figure, path, f"{report.episodes} episodes; {shown}")
