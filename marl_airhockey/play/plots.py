"""Plot of a report."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from marl_airhockey.evaluation.charts import DPI, INK, INKS, save, tidy
from marl_airhockey.play.measures import Player
from marl_airhockey.play.report import Report

MOST = 4
"""Largest number of players whose distributions are drawn."""
LINE = 0.2
"""Height of a player's line in the panel of scores, inches."""


def plot_report(report: Report, path: Path) -> None:
    """Write a PNG of scores, round trips, speed and placement of shots."""
    ranked = sorted(report.players.values(), key=lambda p: (not p.person, -p.games))
    shown = list(zip(ranked, (INK, *INKS), strict=False))[:MOST]
    scored = sum(bool(row["games"]) for row in report.rows())
    heights = max(3.0, LINE * scored), 3.0
    figure, grid = plt.subplots(
        *(2, 2),
        figsize=(9, sum(heights)),
        height_ratios=heights,
        dpi=DPI,
        layout="constrained",
    )
    _scores(grid[0, 0], report)
    panels = (
        (grid[0, 1], "delays", "round trip of the page, ms"),
        (grid[1, 0], "shot_speeds", "speed of shots, m/s"),
        (grid[1, 1], "shot_placements", "offset at which shots would arrive, m"),
    )
    for axes, name, label in panels:
        _distributions(axes, name, label, shown)
    save(figure, path)


def _scores(axes: Axes, report: Report) -> None:
    """Draw each player's score with its interval."""
    rows = [row for row in report.rows() if row["games"]][::-1]
    for k, row in enumerate(rows):
        middle, low, high = row["score"]
        ink = INK if row["person"] else INKS[0]
        axes.plot([low, high], [k, k], color=ink, linewidth=2)
        axes.plot(middle, k, "o", color=ink)
    axes.set_yticks(range(len(rows)), [row["player"] for row in rows])
    axes.axvline(0.5, color=INKS[0], linestyle=":", linewidth=1)
    axes.set(xlim=(-0.02, 1.02), xlabel="score: win + draw / 2 (95 %)")
    tidy(axes, legend=None)


def _distributions(
    axes: Axes,
    name: str,
    label: str,
    players: list[tuple[Player, str]],
) -> None:
    """Draw the cumulative distributions of a field of `Player`."""
    drawn = False
    for player, ink in players:
        values = np.sort(getattr(player, name))
        if len(values) < 2:
            continue
        share = (np.arange(len(values)) + 0.5) / len(values)
        axes.plot(values, share, color=ink, label=f"{player.name} ({len(values)})")
        drawn = True
    axes.set(xlabel=label, ylabel="share at most this", ylim=(0, 1))
    if not drawn:
        axes.text(0.5, 0.5, "seen too seldom", transform=axes.transAxes, ha="center")
    tidy(axes, "best" if drawn else None)
