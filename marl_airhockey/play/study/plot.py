"""Plot of the answers of a study."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from marl_airhockey.evaluation.stats import FEWEST_GROUPS
from marl_airhockey.play.study.plan import SCALE_POINTS
from marl_airhockey.sim.render.charts import panels, point, save, series

COLUMNS = 3
"""Largest number of panels in a row."""
TITLE = 30
"""Largest number of characters in a line of a question."""


def plot_answers(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write a PNG of the rows of `tables.by_question`, with a panel per question."""
    questions = list(dict.fromkeys(row["question"] for row in rows))
    opponents = list(dict.fromkeys(row["opponent"] for row in rows))
    across = min(max(len(questions), 1), COLUMNS)
    down = max(-(-len(questions) // across), 1)
    size = 2.6 * across + 1.6, (0.5 * len(opponents) + 1.2) * down + 0.5
    figure, grid = panels(down, across, size, share_y=True)
    for axes in grid.flat[len(questions) :]:
        axes.set_visible(False)
    for axes, question in zip(grid.flat, questions, strict=False):
        own = [row for row in rows if row["question"] == question]
        for row in own:
            at, (middle, *ends) = opponents.index(row["opponent"]), row["mean"]
            point(axes, at, middle, ends, series(0))
            where = {"textcoords": "offset points", "ha": "center", "fontsize": 7}
            axes.annotate(f"n = {row['n']}", (middle, at), (0, 6), **where)
        is_share = own[0]["scale"] == 1
        axes.set(
            xlim=(-0.08, 1.08) if is_share else (0.6, SCALE_POINTS + 0.4),
            xticks=(0, 0.5, 1) if is_share else range(1, SCALE_POINTS + 1),
            xlabel="share of participants" if is_share else "mean answer",
            # The order of the tables is from top to bottom.
            ylim=(len(opponents) - 0.4, -0.6),
        )
        axes.set_title(textwrap.fill(question, TITLE), fontsize="small")
        axes.set_yticks(range(len(opponents)), opponents)
    many = f"from n = {FEWEST_GROUPS} participants"
    save(figure, path, f"Answers, with 95 % intervals {many}")
