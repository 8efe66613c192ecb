"""Plan of a study: the opponents, their order, the questions."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.study.orders import ORDERS
from marl_airhockey.registry import DEFAULT_BACKEND, runs_code
from marl_airhockey.sim.core.checks import check_fields

EXAMPLE = Path(__file__).parent / "example.toml"
"""Example of a plan's file."""
SCALE_POINTS = 7
"""Points of the scale on which a question is answered."""


@dataclass(frozen=True)
class Question:
    """Question after a block, answered on a scale from 1 to `SCALE_POINTS`.

    With ``choices`` it is answered by one of them instead, the first being 1.

    Raises:
        ValueError: an id of other characters than a-z, 0-9, _; a single choice.
    """

    id: str
    text: str
    low: str = ""
    """Label of the lower end of the scale."""
    high: str = ""
    """Label of the upper end of the scale."""
    choices: tuple[str, ...] = ()
    free: bool = False
    """True for one that is answered in words, or not at all."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not re.fullmatch(r"[a-z0-9_]+", self.id):
            raise ValueError(f"id: {self.id!r} must be of a-z, 0-9 and _")
        if len(self.choices) == 1:
            raise ValueError(f"choices: {self.id} needs at least two")
        if self.free and (self.choices or self.low or self.high):
            raise ValueError(f"free: {self.id} has neither choices nor a scale")

    @property
    def largest(self) -> int:
        """Largest answer; the smallest is 1. 0 for one that is answered in words."""
        return 0 if self.free else len(self.choices) or SCALE_POINTS


QUESTIONS = {
    question.id: question
    for question in (
        Question(
            "origin",
            "Whom did you play against?",
            choices=("a person", "a computer"),
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
"""Questions that a plan can name by their id alone."""


def refuse_code(name: str) -> None:
    """Refuse a name that is Python code: a plan may come from elsewhere.

    Raises:
        ValueError: such a name.
    """
    if runs_code(name):
        raise ValueError(
            f"{name}: a plan runs no code; name a driver or scenario of ours or of an "
            "installed package, or an .npz or .onnx file"
        )


@dataclass(frozen=True)
class Opponent:
    """Driver of all seats but the participant's in a block.

    Raises:
        ValueError: a person with a handicap.
    """

    name: str
    """Name or path of a driver, or "person": somebody at another page."""
    label: str = ""
    """Name in recordings and reports; by default the name and the handicap."""
    handicap: Handicap = field(default_factory=Handicap)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.name == PERSON and self.handicap != Handicap():
            raise ValueError("a plan cannot give a person a handicap")
        refuse_code(self.name)
        if not self.label:
            caption = self.handicap.caption
            label = f"{self.name} ({caption})" if caption else self.name
            object.__setattr__(self, "label", label)


@dataclass(frozen=True)
class Plan:
    """Course of a study, the same for each participant but for the order.

    Raises:
        ValueError: a value out of range, or one that is there twice; names the field.
    """

    scenario: str
    information: str
    """Text that participants read before they agree; paragraphs are kept."""
    agree: tuple[str, ...]
    """Statements that they tick."""
    version: str
    """Version of these texts, kept with each consent."""
    title: str = "Air hockey"
    thanks: str = "Thank you for taking part."
    debriefing: str = ""
    """What participants are told at the end; paragraphs with a blank line between."""
    opponents: tuple[Opponent, ...] = ()
    """Opponents, a block each; none for a scenario of one seat."""
    order: str = "balanced"
    """Name in `orders.ORDERS`."""
    seed: int = 0
    """Seed of the order."""
    games: int = 3
    """Games of a block."""
    practice: int = 1
    """Games before the first block, which no report counts; 0 for none."""
    practice_opponent: Opponent = Opponent("allround:strength=weak")
    rest: float = 30.0
    """Shortest break between blocks, s."""
    blind: bool = True
    """True if participants see "Opponent 1" instead of a name."""
    questions: tuple[Question, ...] = tuple(QUESTIONS.values())
    backend: str = DEFAULT_BACKEND
    profile: str = "ideal"
    options: dict[str, Any] = field(default_factory=dict)
    """Options of the scenario."""
    digest: str = ""
    """Digest of the plan's file, first 12 hexadecimal digits of SHA-256."""

    def __post_init__(self) -> None:
        check_fields(self, games=(1, 1000), practice=(0, 1000), rest=(0, 86_400))
        refuse_code(self.scenario)
        if self.order not in ORDERS:
            known = ", ".join(ORDERS)
            raise ValueError(f"order: {self.order!r} is unknown; there are {known}")
        if not self.agree:
            raise ValueError("agree: participants must have a line to agree to")
        if self.seed < 0:
            raise ValueError(f"seed: {self.seed} must be at least 0")
        for name, keys in (
            ("opponents", [opponent.label for opponent in self.opponents]),
            ("questions", [question.id for question in self.questions]),
        ):
            twice = {key for key in keys if keys.count(key) > 1}
            if twice:
                raise ValueError(f"{name}: {', '.join(sorted(twice))} is there twice")

    @property
    def blocks(self) -> int:
        """Number of blocks that a participant plays, practice not counted."""
        return max(len(self.opponents), 1)

    def sequence(self, number: int) -> list[int]:
        """Return the order of opponents, by index, of a participant, counted from 0."""
        return ORDERS[self.order](self.blocks, self.seed, number)
