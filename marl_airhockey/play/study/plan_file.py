"""Reader of plans in TOML, which names the key that is wrong."""

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
    """Keys of an opponent in the file."""

    name: str
    label: str = ""
    reaction: float = Handicap.reaction
    """Delay of its actions, s."""
    noise: float = Handicap.noise
    pace: float = Handicap.pace

    def __post_init__(self) -> None:
        check_fields(self)


def load_plan(path: Path) -> Plan:
    """Read a plan from TOML.

    Raises:
        ValueError: names the file and the key that is wrong.
    """
    try:
        text = path.read_text()
        data = tomllib.loads(text)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: no TOML: {error}") from error
    try:
        for name, read in (("opponents", _opponent), ("questions", _question)):
            if isinstance(data.get(name), list):
                data[name] = tuple(read(row) for row in data[name])
        if "practice_opponent" in data:
            data["practice_opponent"] = _opponent(data["practice_opponent"])
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        if "digest" in data:
            raise ValueError("digest: unknown; it is made from the file")
        return build(Plan, {**data, "digest": digest})
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _opponent(row: Any) -> Opponent:
    """Return the opponent of a name or a table."""
    named = {"name": row} if isinstance(row, str) else row
    table = build(_OpponentTable, named, "opponents")
    try:
        handicap = Handicap(table.reaction, table.noise, table.pace)
    except ValueError as error:
        raise ValueError(f"opponent {table.name}: {error}") from error
    return Opponent(table.name, table.label, handicap)


def _question(row: Any) -> Question:
    """Return the question of an id or a table."""
    if not isinstance(row, str):
        return build(Question, row, "questions")
    if row not in QUESTIONS:
        raise ValueError(
            f"questions: {row!r} is not shipped ({', '.join(QUESTIONS)} are): "
            'write your own as {id = "...", text = "..."}'
        )
    return QUESTIONS[row]
