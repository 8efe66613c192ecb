"""Games and answers of a study, from its diaries."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from marl_airhockey.evaluation.charts import DPI, INK, INKS, save, tidy
from marl_airhockey.evaluation.stats import bootstrap, interval
from marl_airhockey.play.report import RESAMPLES, shown
from marl_airhockey.study.archive import diaries
from marl_airhockey.study.plan import SCALE_POINTS
from marl_airhockey.types import Array

GAMES = (
    *("participant", "number", "complete", "block", "game", "practice", "opponent"),
    *("result", "score", "seconds", "pauses", "recording", "at"),
)
"""Columns of a game."""
ANSWERS = (
    *("participant", "number", "complete", "block", "opponent"),
    *("question", "value", "choice", "at"),
)
"""Columns of an answer."""
FEWEST = 5
"""Answers from which a mean has an interval."""


@dataclass(frozen=True)
class Answers:
    """Games and answers as rows, and counts of participants."""

    games: list[dict[str, Any]]
    """Rows of `GAMES`; the participant's result: won, lost, drawn, broken off."""
    answers: list[dict[str, Any]]
    """Rows of `ANSWERS`."""
    participants: int
    complete: int
    """Number of participants who came to the end."""

    def table(self) -> list[dict[str, Any]]:
        """Return rows by question and opponent: the mean answer, 1 to 7.

        ``mean`` is a list (mean, low, high) with the 95 % interval, nan without one.

        A question with choices has a row for each choice instead: the share that chose
        it. ``scale`` is the largest possible value.
        """
        rows = []
        questions = dict.fromkeys(row["question"] for row in self.answers)
        opponents = sorted({row["opponent"] for row in self.answers})
        for question, opponent in itertools.product(questions, opponents):
            found = [
                row
                for row in self.answers
                if (row["question"], row["opponent"]) == (question, opponent)
            ]
            group = {"opponent": opponent, "n": len(found)}
            chosen = [row["choice"] for row in found if row["choice"]]
            for choice in sorted(set(chosen)):
                share = chosen.count(choice) / len(chosen)
                middle = [share, *interval(share, len(chosen))]
                name = f"{question}: {choice}"
                rows.append({"question": name, **group, "scale": 1, "mean": middle})
            if found and not chosen:
                values = np.array([row["value"] for row in found])
                middle = [float(values.mean()), *_bounds(values)]
                rows.append(
                    {
                        "question": question,
                        **group,
                        "scale": SCALE_POINTS,
                        "mean": middle,
                    }
                )
        return rows

    def to_markdown(self) -> str:
        """Return a table with a legend."""
        lines = [
            f"# {self.participants} participants, {self.complete} to the end",
            "",
            "| question | opponent | answers | mean (95 %) |",
            "| --- | --- | --- | --- |",
        ]
        for row in self.table():
            lines.append(
                f"| {row['question']} | {row['opponent']} | {row['n']} "
                f"| {shown(row['mean'], 2)} |"
            )
        lines += [
            "",
            "With a choice: the share that chose it (Wilson's interval). Others: means "
            f"of 1 to {SCALE_POINTS} (bootstrap, from {FEWEST} answers on).",
        ]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write ``games.csv``, ``answers.csv``, ``answers.md``, ``answers.png``.

        Returns:
            Their paths.
        """
        folder.mkdir(parents=True, exist_ok=True)
        files = [
            folder / name
            for name in ("games.csv", "answers.csv", "answers.md", "answers.png")
        ]
        _write(files[0], GAMES, self.games)
        _write(files[1], ANSWERS, self.answers)
        files[2].write_text(self.to_markdown())
        self._draw(files[3])
        return files

    def _draw(self, path: Path) -> None:
        """Write a PNG of `table`, a panel for each question."""
        rows = self.table()
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
            for row in rows:
                if row["question"] != question:
                    continue
                at, scale = opponents.index(row["opponent"]), row["scale"]
                middle, low, high = row["mean"]
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
            axes.set(
                xlim=(-0.05, 1.05) if scale == 1 else (0.7, SCALE_POINTS + 0.3),
                xticks=(0, 0.5, 1) if scale == 1 else range(1, SCALE_POINTS + 1),
                xlabel=question,
            )
            axes.set_yticks(range(len(opponents)), opponents)
            tidy(axes, legend=None)
        save(figure, path)


def _bounds(values: Array) -> tuple[float, float]:
    """Return the 95 % interval of a mean; nan for fewer than `FEWEST` values."""
    if len(values) < FEWEST:
        return float("nan"), float("nan")
    return bootstrap(values, lambda x: float(np.mean(x)), resamples=RESAMPLES)


def _write(path: Path, names: Sequence[str], rows: list[dict[str, Any]]) -> None:
    """Write rows as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)


def read_answers(folder: Path) -> Answers:
    """Read the diaries of a study's participants."""
    games: list[dict[str, Any]] = []
    answers: list[dict[str, Any]] = []
    participants = complete = 0
    for diary in diaries(folder):
        first = diary.rows[0]
        if first["role"] != "participant":
            continue
        done = any(row.get("reason") == "complete" for row in diary.rows)
        participants, complete = participants + 1, complete + done
        who = {"participant": diary.code, "number": diary.number, "complete": done}
        for row in diary.rows[1:]:
            both = {**who, **row}
            if row["kind"] == "game":
                games.append({k: both[k] for k in GAMES})
            elif row["kind"] == "answer":
                answers.append({k: both[k] for k in ANSWERS})
    return Answers(games, answers, participants, complete)
