"""Reader of plans in TOML, which names the key that is wrong."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.study.plan import QUESTIONS, Opponent, Plan, Question

T = TypeVar("T")

_KINDS: dict[str, tuple[type, ...]] = {
    "str": (str,),
    "int": (int,),
    "float": (int, float),
    "bool": (bool,),
    "dict[str, Any]": (dict,),
    "tuple[str, ...]": (list,),
    "Opponent": (Opponent,),
    "tuple[Opponent, ...]": (tuple,),
    "tuple[Question, ...]": (tuple,),
}
"""Types of values, from TOML or from this file, by the annotation of a field."""


@dataclass(frozen=True)
class _OpponentTable:
    """Keys of an opponent in the file."""

    name: str
    label: str = ""
    reaction: float = Handicap.reaction
    """Delay of its actions, s."""
    noise: float = Handicap.noise
    pace: float = Handicap.pace


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
            if name in data:
                data[name] = tuple(read(row) for row in _list(name, data[name]))
        if "practice_opponent" in data:
            data["practice_opponent"] = _opponent(data["practice_opponent"])
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        if "digest" in data:
            raise ValueError("digest: unknown; it is made from the file")
        return _build(Plan, "the plan", {**data, "digest": digest})
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _opponent(row: Any) -> Opponent:
    """Return the opponent of a name or a table."""
    named = {"name": row} if isinstance(row, str) else row
    table = _build(_OpponentTable, "an opponent", named)
    try:
        handicap = Handicap(table.reaction, table.noise, table.pace)
    except ValueError as error:
        raise ValueError(f"opponent {table.name}: {error}") from error
    return Opponent(table.name, table.label, handicap)


def _question(row: Any) -> Question:
    """Return the question of an id or a table."""
    if not isinstance(row, str):
        return _build(Question, "a question", row)
    if row not in QUESTIONS:
        raise ValueError(
            f"questions: {row!r} is not shipped ({', '.join(QUESTIONS)} are): "
            'write your own as {id = "...", text = "..."}'
        )
    return QUESTIONS[row]


def _list(name: str, value: Any) -> list[Any]:
    """Return a value that must be a list."""
    if not isinstance(value, list):
        raise ValueError(f"{name}: must be a list")
    return value


def _build(kind: type[T], what: str, row: Any) -> T:
    """Return a dataclass made of a table, whose keys and types of values are checked.

    Raises:
        ValueError: no table, an unknown key, a missing one, or a value of a wrong type.
    """
    if not isinstance(row, dict):
        raise ValueError(f"{what} must be a table, not {row!r}")
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    for name, value in row.items():
        if name not in known:
            open_ones = ", ".join(name for name in known if name != "digest")
            raise ValueError(f"{name}: unknown; {what} has {open_ones}")
        wanted = _KINDS[str(known[name].type)]
        wrong = isinstance(value, bool) and bool not in wanted
        if wrong or not isinstance(value, wanted):
            raise ValueError(f"{name}: {value!r} is not of the kind {known[name].type}")
        if isinstance(value, list) and not all(isinstance(x, str) for x in value):
            raise ValueError(f"{name}: must be a list of texts")
    texts = {k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}
    try:
        return kind(**texts)
    except TypeError as error:  # "missing 1 required positional argument: 'name'"
        raise ValueError(f"{what} lacks{str(error).partition(':')[2]}") from error
