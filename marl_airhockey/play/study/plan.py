"""Plan of a study: opponents, their order, and questions."""

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
"""Example of a plan file."""
SCALE_POINTS = 7
"""Number of points of the scale of a question."""


@dataclass(frozen=True)
class Question:
    """Question after a block, answered on a scale from 1 to `SCALE_POINTS`.

    A question with ``choices`` is answered by the number of one of them, from 1.

    Raises:
        ValueError: The id has other characters than a-z, 0-9 and _, there is a single
            choice, or a free question has choices or a scale.
    """

    id: str
    text: str
    low: str = ""
    """Label of the lower end of the scale."""
    high: str = ""
    """Label of the upper end of the scale."""
    choices: tuple[str, ...] = ()
    free: bool = False
    """True for a question that is answered by a text, which may be empty."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not re.fullmatch(r"[a-z0-9_]+", self.id):
            raise ValueError(f"id: {self.id!r} must consist of a-z, 0-9 and _")
        if len(self.choices) == 1:
            raise ValueError(f"choices: {self.id} needs at least two choices")
        if self.free and (self.choices or self.low or self.high):
            raise ValueError(
                f"free: {self.id} is free, so it must not have choices, low or high"
            )

    @property
    def largest(self) -> int:
        """Largest answer; the smallest answer is 1. It is 0 for a free question."""
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
"""Questions that a plan can name by their id."""


def refuse_code(name: str) -> None:
    """Check that a name is not Python code, because a plan can be untrusted.

    Raises:
        ValueError: The name is Python code.
    """
    if runs_code(name):
        raise ValueError(
            f"{name}: a plan cannot run Python code; give a driver or scenario of this "
            "library or of an installed package, or an .npz or .onnx file"
        )


@dataclass(frozen=True)
class Opponent:
    """Driver of all seats except the participant's in a block.

    Raises:
        ValueError: A person has a handicap, or the name is Python code.
    """

    name: str
    """Name or path of a driver, or "person" for a person at another page."""
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
    """Course of a study, which only differs in the order between participants.

    Raises:
        ValueError: A value is out of range, or is given twice.
    """

    scenario: str
    information: str
    """Text that participants read before they agree, with blank lines between
    paragraphs."""
    agree: tuple[str, ...]
    """Statements that participants tick."""
    version: str
    """Version of these texts, which is stored with each consent."""
    title: str = "Air hockey"
    thanks: str = "Thank you for taking part."
    debriefing: str = ""
    """Text that participants read at the end, with blank lines between paragraphs."""
    opponents: tuple[Opponent, ...] = ()
    """Opponents of the blocks; none for a scenario with one seat."""
    order: str = "balanced"
    """Name of the order in `orders.ORDERS`."""
    seed: int = 0
    """Seed of the order."""
    games: int = 3
    """Number of games of a block."""
    practice: int = 1
    """Number of games before the first block, which do not count; 0 for none."""
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
            raise ValueError(f"order: {self.order!r}; expected one of {known}")
        if not self.agree:
            raise ValueError("agree: expected at least one statement")
        if self.seed < 0:
            raise ValueError(f"seed: {self.seed} must be at least 0")
        for name, keys in (
            ("opponents", [opponent.label for opponent in self.opponents]),
            ("questions", [question.id for question in self.questions]),
        ):
            twice = {key for key in keys if keys.count(key) > 1}
            if twice:
                raise ValueError(f"{name}: {', '.join(sorted(twice))} is given twice")

    @property
    def blocks(self) -> int:
        """Number of blocks of a participant, without practice."""
        return max(len(self.opponents), 1)

    def sequence(self, number: int) -> list[int]:
        """Return the indices of the opponents of a participant, in order.

        Args:
            number: Number of the participant, from 0.
        """
        return ORDERS[self.order](self.blocks, self.seed, number)
