"""Reader of plans in TOML files."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.study.plan import QUESTIONS, Opponent, Plan, Question
from marl_airhockey.sim.core.checks import build, check_fields


@dataclass(frozen=True)
class _OpponentTable:
    """Keys of an opponent in a plan file."""

    name: str
    label: str = ""
    reaction: float = Handicap.reaction
    """Latency of the actions, s."""
    noise: float = Handicap.noise
    pace: float = Handicap.pace

    def __post_init__(self) -> None:
        check_fields(self)


def load_plan(path: Path) -> Plan:
    """Read a plan from a TOML file.

    Raises:
        ValueError: The file cannot be read, or the value of a key is invalid.
    """
    try:
        text = path.read_text()
        data = tomllib.loads(text)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not a TOML file: {error}") from error
    try:
        for name, read in (("opponents", _opponent), ("questions", _question)):
            if isinstance(data.get(name), list):
                data[name] = tuple(read(row) for row in data[name])
        if "practice_opponent" in data:
            data["practice_opponent"] = _opponent(data["practice_opponent"])
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        if "digest" in data:
            raise ValueError("digest: this key is computed from the file; remove it")
        return build(Plan, {**data, "digest": digest})
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _opponent(row: Any) -> Opponent:
    """Return the opponent that a name or a table describes."""
    named = {"name": row} if isinstance(row, str) else row
    table = build(_OpponentTable, named, "opponents")
    try:
        handicap = Handicap(table.reaction, table.noise, table.pace)
    except ValueError as error:
        raise ValueError(f"opponent {table.name}: {error}") from error
    return Opponent(table.name, table.label, handicap)


def _question(row: Any) -> Question:
    """Return the question that an id or a table describes."""
    if not isinstance(row, str):
        return build(Question, row, "questions")
    if row not in QUESTIONS:
        raise ValueError(
            f"questions: unknown id {row!r}; expected one of {', '.join(QUESTIONS)}, "
            'or your own question {id = "...", text = "..."}'
        )
    return QUESTIONS[row]
