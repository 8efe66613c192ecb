"""Tables of a study by question, opponent, participant and order."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from marl_airhockey.evaluation.stats import FEWEST_GROUPS, bounded_mean
from marl_airhockey.play.cells import markdown, shown, write_csv
from marl_airhockey.play.report import share
from marl_airhockey.play.study.answers import ANSWERS, GAMES, MEASURES, POINTS, Answers
from marl_airhockey.play.study.archive import TABLES
from marl_airhockey.play.study.plan import SCALE_POINTS

Row = dict[str, Any]
LEGEND = (
    f"Answers: means on a scale from 1 to {SCALE_POINTS}, or the share of participants "
    "with this choice. Score: win + draw / 2. Intervals are over participants, because "
    "the games of a participant are not independent. There is no interval for fewer "
    f"than {FEWEST_GROUPS} participants. Games that were aborted or interrupted, and "
    "practice games, do not count."
)


def by_question(found: Answers) -> list[Row]:
    """Return the mean answers as rows by question and opponent.

    ``mean`` is a list (mean, low, high) with the 95 % interval, or nan for no interval.
    A question with choices has a row for each choice, with the share of participants
    who chose it. ``scale`` is the largest possible value.
    """
    rows: list[Row] = []
    answers = [row for row in found.answers if row["value"] is not None]
    for question, opponent in _pairs(answers, "question", "opponent"):
        chosen = [
            row
            for row in answers
            if (row["question"], row["opponent"]) == (question, opponent)
        ]
        if not chosen:
            continue
        group = {"opponent": opponent, "n": len(_groups(chosen, _value))}
        for choice in sorted({row["choice"] for row in chosen} - {""}):
            chose = _groups(chosen, partial(_chose, choice))
            name = f"{question}: {choice}"
            rows.append({"question": name, **group, "scale": 1, "mean": share(chose)})
        if not chosen[0]["choice"]:
            mean = bounded_mean(_groups(chosen, _value), (1.0, SCALE_POINTS))
            scale = {"scale": SCALE_POINTS, "mean": mean}
            rows.append({"question": question, **group, **scale})
    return rows


def by_opponent(found: Answers) -> list[Row]:
    """Return the score against each opponent with its interval over participants."""
    games = found.counted()
    rows = []
    for opponent in sorted({game["opponent"] for game in games}):
        own = [game for game in games if game["opponent"] == opponent]
        groups = _groups(own, _points)
        counts = {"n": len(groups), "games": len(own)}
        rows.append({"opponent": opponent, **counts, "score": share(groups)})
    return rows


def by_participant(found: Answers) -> list[list[object]]:
    """Return a table of points by participant and opponent; the header is first."""
    games = found.counted()
    opponents = sorted({game["opponent"] for game in games})
    rows: list[list[object]] = [["number", "participant", *opponents]]
    people = sorted({(game["number"], game["participant"]) for game in games})
    for number, code in people:
        own = [game for game in games if game["participant"] == code]
        cells = []
        for opponent in opponents:
            points = [_points(game) for game in own if game["opponent"] == opponent]
            cells.append(f"{sum(points):g} of {len(points)}" if points else "-")
        rows.append([number, code, *cells])
    return rows


def order_table(found: Answers) -> list[list[object]]:
    """Return a table of scores by opponent and block; the header is first."""
    games = found.counted()
    blocks = sorted({game["block"] for game in games})
    rows: list[list[object]] = [["opponent", *(f"block {block}" for block in blocks)]]
    for opponent in sorted({game["opponent"] for game in games}):
        cells = []
        for block in blocks:
            own = [
                game
                for game in games
                if (game["opponent"], game["block"]) == (opponent, block)
            ]
            groups = _groups(own, _points)
            cells.append(f"{shown(share(groups), 2)}, n = {len(groups)}")
        rows.append([opponent, *cells])
    return rows


def to_markdown(found: Answers) -> str:
    """Return all tables with a legend."""
    questions = [
        (row["question"], row["opponent"], row["n"], shown(row["mean"], 2))
        for row in by_question(found)
    ]
    opponents = [
        (row["opponent"], row["n"], row["games"], shown(row["score"], 2))
        for row in by_opponent(found)
    ]
    header, *people = by_participant(found)
    order, *positions = order_table(found)
    lines = [
        f"# {found.participants} participants, {found.complete} complete",
        *("", "## Answers", ""),
        *markdown(("question", "opponent", "participants", "mean (95 %)"), questions),
        *("", "## Score by opponent", ""),
        *markdown(("opponent", "participants", "games", "score (95 %)"), opponents),
        *("", "## Points by participant and opponent", ""),
        *markdown([str(name) for name in header], people),
        *("", "## Score by opponent and block", ""),
        *markdown([str(name) for name in order], positions),
        *("", LEGEND),
    ]
    return "\n".join(lines) + "\n"


def save(found: Answers, folder: Path) -> list[Path]:
    """Write the CSV files and ``answers.md``, ``answers.png``; return their paths."""
    from marl_airhockey.play.study.plot import plot_answers

    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / name for name in TABLES]
    write_csv(files[0], GAMES, found.games)
    write_csv(files[1], ANSWERS, found.answers)
    write_csv(files[2], MEASURES, found.measures())
    files[3].write_text(to_markdown(found))
    plot_answers(by_question(found), files[4])
    return files


def _pairs(rows: Sequence[Row], *names: str) -> Iterable[tuple[str, ...]]:
    values = (dict.fromkeys(row[name] for row in rows) for name in names)
    return itertools.product(*values)


def _groups(rows: Sequence[Row], value: Callable[[Row], float]) -> list[list[float]]:
    """Return values in groups, one for each participant."""
    found: dict[str, list[float]] = {}
    for row in rows:
        found.setdefault(row["participant"], []).append(value(row))
    return list(found.values())


def _chose(choice: str, row: Row) -> float:
    return float(row["choice"] == choice)


def _value(row: Row) -> float:
    return float(row["value"])


def _points(row: Row) -> float:
    return POINTS[row["result"]]
