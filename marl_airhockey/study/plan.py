"""The plan of a study: who is played against, in which order, what is asked."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from marl_airhockey.play.handicap import Fairness
from marl_airhockey.play.live_match import PERSON

EXAMPLE = Path(__file__).parent / "example.toml"
POINTS = 7
"""Of the scale of a question."""
Part = TypeVar("Part")


@dataclass(frozen=True)
class Question:
    """Something that is asked after a block, answered on a scale from 1 to `POINTS`.

    With ``choices`` it is answered by one of them instead, the first being 1.
    """

    id: str
    text: str
    low: str = ""
    """Words at the lower end of the scale."""
    high: str = ""
    choices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z0-9_]+", self.id):
            raise ValueError(f"id: {self.id!r} must be of a-z, 0-9 and _")
        if len(self.choices) == 1:
            raise ValueError(f"choices: {self.id} needs at least two")

    @property
    def most(self) -> int:
        """The largest answer; the smallest is 1."""
        return len(self.choices) or POINTS


QUESTIONS = {
    question.id: question
    for question in (
        Question(
            "origin",
            "Whom did you play against?",
            choices=("a person", "a program"),
        ),
        Question(
            "certainty", "How sure are you of that?", "I am guessing", "I am certain"
        ),
        Question(
            "workload", "How demanding was it to play?", "not at all", "extremely"
        ),
        Question(
            "frustration", "How frustrated did you feel?", "not at all", "extremely"
        ),
    )
}
"""What can be asked by its name alone."""


@dataclass(frozen=True)
class Opponent:
    """Who sits at all other seats in a block."""

    name: str
    """A driver's name or path, or "person": somebody at another page."""
    label: str = ""
    """What recordings and reports call it; its name and how it is held back."""
    reaction: float = 0.0
    """ms by which it acts late."""
    noise: float = 0.0
    pace: float = 1.0

    def __post_init__(self) -> None:
        if self.name == PERSON and self.fairness != Fairness():
            raise ValueError("a person cannot be held back by a plan")
        for name, low, most in (
            ("reaction", 0, 300),
            ("noise", 0, 1),
            ("pace", 0.05, 1),
        ):
            value = getattr(self, name)
            if not low <= value <= most:
                raise ValueError(
                    f"{name}: {value:g} of {self.name} must be in {low} .. {most}"
                )
        if not self.label:
            held = self.fairness.words
            label = f"{self.name} ({held})" if held else self.name
            object.__setattr__(self, "label", label)

    @property
    def fairness(self) -> Fairness:
        """How it is held back."""
        return Fairness(self.reaction / 1000.0, self.noise, self.pace)


@dataclass(frozen=True)
class Plan:
    """What a study does with each participant."""

    scenario: str
    information: str
    """What participants read before they agree; paragraphs are kept."""
    agree: tuple[str, ...]
    """What they tick, line by line."""
    version: str
    """Of these texts, kept with each consent."""
    title: str = "Air hockey"
    thanks: str = "Thank you for taking part."
    opponents: tuple[Opponent, ...] = ()
    """One block each; none for a scenario of one seat."""
    order: str = "balanced"
    seed: int = 0
    games: int = 3
    """Of a block."""
    practice: int = 1
    """Games before the first block, which count for nothing; 0 for none."""
    practice_opponent: Opponent = Opponent("allround:strength=weak")
    rest: float = 30.0
    """s between blocks, at least."""
    blind: bool = True
    """Participants see "opponent 1", not a name."""
    questions: tuple[Question, ...] = tuple(QUESTIONS.values())
    backend: str = "pymunk"
    profile: str = "ideal"
    options: dict[str, Any] = field(default_factory=dict)
    """Of the scenario."""
    digest: str = ""
    """Of the file that it came from."""

    def __post_init__(self) -> None:
        if self.order not in ORDERS:
            known = ", ".join(ORDERS)
            raise ValueError(f"order: {self.order!r} is unknown; there are {known}")
        if not self.agree:
            raise ValueError("agree: participants must have a line to agree to")
        for name, least in (("games", 1), ("practice", 0), ("rest", 0), ("seed", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name}: must be at least {least}")
        for name, keys in (
            ("opponents", [opponent.label for opponent in self.opponents]),
            ("questions", [question.id for question in self.questions]),
        ):
            twice = {key for key in keys if keys.count(key) > 1}
            if twice:
                raise ValueError(f"{name}: {', '.join(sorted(twice))} is there twice")

    @property
    def blocks(self) -> int:
        """How many blocks a participant plays, practice not counted."""
        return max(len(self.opponents), 1)

    def sequence(self, number: int) -> list[int]:
        """The order in which the participant with a number, from 0, meets opponents."""
        return ORDERS[self.order](self.blocks, self.seed, number)


def load(path: Path) -> Plan:
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
    return _build(Opponent, "an opponent", {"name": row} if _is_text(row) else row)


def _question(row: Any) -> Question:
    if not _is_text(row):
        return _build(Question, "a question", row)
    if row not in QUESTIONS:
        raise ValueError(
            f"questions: {row!r} is not shipped ({', '.join(QUESTIONS)} are): "
            'write your own as {id = "...", text = "..."}'
        )
    return QUESTIONS[row]


def _is_text(row: Any) -> bool:
    return isinstance(row, str)


def _list(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{name}: must be a list")
    return value


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
"""What TOML, or this file, must have made of a field."""


def _build(kind: type[Part], what: str, row: Any) -> Part:
    """A part of a plan from a table, whose keys and kinds are checked."""
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


def _balanced(count: int, seed: int, number: int) -> list[int]:
    """A row of a Latin square in which each comes after each other equally often.

    Williams (1949): for an even number one square is enough, for an odd one its mirror
    image is the other half; which opponent is which letter is drawn by the seed.
    """
    first = [0]
    for k in range(1, count):
        first.append((first[-1] + (k if k % 2 else -k)) % count)
    rows = count if count % 2 == 0 else 2 * count
    row = number % rows
    letters = [(letter + row) % count for letter in first]
    if row >= count:
        letters.reverse()
    names = np.random.default_rng(seed).permutation(count)
    return [int(names[letter]) for letter in letters]


def _random(count: int, seed: int, number: int) -> list[int]:
    drawn: list[int] = np.random.default_rng([seed, number]).permutation(count).tolist()
    return drawn


def _fixed(count: int, seed: int, number: int) -> list[int]:
    return list(range(count))


ORDERS: dict[str, Callable[[int, int, int], list[int]]] = {
    "balanced": _balanced,
    "random": _random,
    "fixed": _fixed,
}
"""Ways to order the opponents, by number of opponents, seed and participant."""
