"""Games and answers of a study as rows, from its event logs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marl_airhockey.play.study.archive import Diary, diaries

_WHO = ("participant", "number", "complete", "block", "opponent")
GAMES = (
    *(*_WHO, "game", "practice", "result", "rule", "score", "seconds", "pauses"),
    *("input", "width", "height", "density", "hz", "recording", "at"),
)
"""Columns of a game, with the devices of the page, see `protocol.MESSAGES`."""
ANSWERS = (*_WHO, "question", "value", "choice", "text", "at")
"""Columns of an answer."""
MEASURES = (*_WHO, "game", "measure", "value")
"""Columns of the long table."""
CUT_OFF = "cut off"
"""Result of a game that was interrupted by a crash of the server."""
POINTS = {"won": 1.0, "drawn": 0.5, "lost": 0.0}
"""Points of the participant by the result of a game."""


@dataclass(frozen=True)
class Answers:
    """Games and answers as rows, and numbers of participants."""

    games: list[dict[str, Any]]
    """Rows of `GAMES`; a result is won, lost, drawn, `BROKEN_OFF` or `CUT_OFF`."""
    answers: list[dict[str, Any]]
    """Rows of `ANSWERS`."""
    scores: list[dict[str, float]]
    """Scores of each game, by name, of the participant and of others."""
    participants: int
    complete: int
    """Number of participants who completed the plan."""

    def counted(self) -> list[dict[str, Any]]:
        """Return the games that count: completed games without practice."""
        return [g for g in self.games if not g["practice"] and g["result"] in POINTS]

    def measures(self) -> list[dict[str, Any]]:
        """Return rows of `MEASURES`, one for each number of a game or an answer."""
        rows = []
        for game, scores in zip(self.games, self.scores, strict=True):
            if game["practice"] or game["result"] not in POINTS:
                continue
            values = {"points": POINTS[game["result"]], "seconds": game["seconds"]}
            values |= {"pauses": game["pauses"], **scores}
            who = {name: game[name] for name in (*_WHO, "game")}
            rows += [{**who, "measure": k, "value": v} for k, v in values.items()]
        for answer in self.answers:
            if answer["value"] is not None:
                who = {name: answer[name] for name in _WHO} | {"game": ""}
                rows.append(
                    {**who, "measure": answer["question"], "value": answer["value"]}
                )
        return rows


def read_answers(folder: Path) -> Answers:
    """Read the event logs of the participants of a study."""
    found = Answers([], [], [], 0, 0)
    participants = complete = 0
    for diary in diaries(folder):
        first = diary.rows[0]
        if first["role"] != "participant":
            continue
        done = any(row.get("reason") == "complete" for row in diary.rows)
        participants, complete = participants + 1, complete + done
        who = {"participant": diary.code, "number": diary.number, "complete": done}
        for row in _games_of(diary):
            both = {**dict.fromkeys(GAMES, ""), **(row.get("device") or {}), **row}
            found.games.append({k: {**both, **who}[k] for k in GAMES})
            found.scores.append(_by_side(row.get("scores", {})))
        for row in diary.rows:
            if row["kind"] == "answer":
                both = {"text": "", **who, **row}
                found.answers.append({k: both[k] for k in ANSWERS})
    return Answers(found.games, found.answers, found.scores, participants, complete)


def _games_of(diary: Diary) -> Iterator[dict[str, Any]]:
    """Yield the games of an event log, including those interrupted by a crash."""
    begun: dict[str, Any] | None = None
    for row in diary.rows:
        if row["kind"] in ("begin", "game") and begun is not None:
            if row["kind"] == "begin":
                yield {**begun, "result": CUT_OFF}
            begun = None
        if row["kind"] == "begin":
            begun = row
        elif row["kind"] == "recording" and begun is not None:
            begun = {**begun, "recording": row["recording"]}
        elif row["kind"] == "game":
            yield row
    if begun is not None:
        yield {**begun, "result": CUT_OFF}


def _by_side(scores: dict[str, list[float]]) -> dict[str, float]:
    """Return scores by name, of the participant and of all others."""
    found = {}
    for name, counts in scores.items():
        found[name] = counts[0]
        if len(counts) > 1:
            found[f"{name} of others"] = sum(counts[1:])
    return found
