"""Plot of the answers of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from marl_airhockey.play.study.plan import SCALE_POINTS
from marl_airhockey.sim.render.charts import DPI, INK, INKS, save, tidy


def plot_answers(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write a PNG of the rows of `tables.by_question`, with a panel per question."""
    questions = list(dict.fromkeys(row["question"] for row in rows))
    opponents = list(dict.fromkeys(row["opponent"] for row in rows))
    figure, grid = plt.subplots(
        1,
        max(len(questions), 1),
        figsize=(2.6 * max(len(questions), 1) + 1.4, 0.6 * len(opponents) + 1.4),
        dpi=DPI,
        layout="constrained",
        sharey=True,
        squeeze=False,
    )
    for axes, question in zip(grid[0], questions, strict=False):
        own = [row for row in rows if row["question"] == question]
        for row in own:
            at, (middle, low, high) = opponents.index(row["opponent"]), row["mean"]
            axes.plot([low, high], [at, at], color=INKS[0], linewidth=2)
            axes.plot(middle, at, "o", color=INK)
            axes.annotate(
                f"n = {row['n']}",
                (middle, at),
                (0, 6),
                textcoords="offset points",
                ha="center",
                fontsize=7,
            )
        is_share = own[0]["scale"] == 1
        axes.set(
            xlim=(-0.05, 1.05) if is_share else (0.7, SCALE_POINTS + 0.3),
            xticks=(0, 0.5, 1) if is_share else range(1, SCALE_POINTS + 1),
            xlabel=question,
        )
        axes.set_yticks(range(len(opponents)), opponents)
        tidy(axes, legend=None)
    save(figure, path)
