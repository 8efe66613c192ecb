"""A participant's way through a plan: practice, blocks of games, questions, breaks."""

from __future__ import annotations

from typing import Any

from marl_airhockey.study.archive import Diary
from marl_airhockey.study.plan import Opponent, Plan

VERDICT = 2.5
"""s for which the end of a game is shown before what comes next."""
BROKEN = "broken off"
"""Result of a game that does not count."""


class Course:
    """Where a participant is in a plan; goes on from what the diary says.

    Args:
        plan: of the study.
        diary: of the participant.
    """

    def __init__(self, plan: Plan, diary: Diary) -> None:
        self.plan, self.diary = plan, diary
        self.stage = "ready"
        """ready, match, over, questions, rest, end"""
        self.left = 0.0
        """s of a rest, or of the sight of a verdict."""
        self.block, self.game = 0, 0
        """The block, -1 for practice; how many of its games are over."""
        self._answers: dict[str, int] = {}
        self._enter(-1 if plan.practice else 0)
        for row in list(diary.rows):
            self._follow(row)

    @property
    def games(self) -> int:
        """Of this block."""
        return self.plan.practice if self.block < 0 else self.plan.games

    @property
    def opponent(self) -> Opponent | None:
        """Whom the participant meets in this block; nobody in a game of one seat."""
        plan, block = self.plan, self.block
        if not plan.opponents or block == plan.blocks:
            return None
        if block < 0:
            return plan.practice_opponent
        return plan.opponents[plan.sequence(self.diary.number)[block]]

    @property
    def title(self) -> str:
        """What the participant may know of the opponent."""
        if self.opponent is None:
            return ""
        if not self.plan.blind:
            return self.opponent.label
        return "Practice" if self.block < 0 else f"Opponent {self.block + 1}"

    @property
    def place(self) -> dict[str, Any]:
        """Where the participant is, for recordings and the diary."""
        return {
            "block": self.block + 1,
            "game": self.game + 1,
            "practice": self.block < 0,
            "opponent": self.opponent.label if self.opponent else "",
        }

    def begin(self) -> None:
        """The next game of the block."""
        self.stage = "match"

    def note(self, result: str, **facts: Any) -> None:
        """A game is over; one that was broken off is played again."""
        self.diary.write("game", **self.place, result=result, **facts)
        self.game += result != BROKEN
        self.stage, self.left = "over", VERDICT

    def wait(self, seconds: float) -> None:
        """Let time pass: a verdict was seen, a rest may be over."""
        self.left = max(self.left - seconds, 0.0)
        if self.left == 0.0 and self.stage == "over":
            self._lead_on()
        elif self.left == 0.0 and self.stage == "rest":
            self.stage = "ready"

    def answer(self, question: str, value: int) -> None:
        """Take an answer; with the last one the block is over.

        Raises:
            ValueError: a question, or a value, that the plan does not have.
        """
        asked = {q.id: q for q in self.plan.questions}
        if question not in asked or not 1 <= value <= asked[question].most:
            raise ValueError(f"answer: {question} {value} is not asked for")
        if self.stage != "questions":
            return
        self._answers[question] = value
        if self._answers.keys() < asked.keys():
            return
        place = self.place
        for name, given in self._answers.items():
            choices = asked[name].choices
            self.diary.write(
                "answer",
                block=place["block"],
                opponent=place["opponent"],
                question=name,
                value=given,
                choice=choices[given - 1] if choices else "",
            )
        self._enter(self.block + 1)

    def _enter(self, block: int) -> None:
        """Begin a block; -1 is practice."""
        self.block, self.game, self._answers = block, 0, {}
        if block == self.plan.blocks:
            self.stage = "end"
            if not self.diary.over:
                self.diary.write("end", reason="complete")
            return
        self.left = self.plan.rest if block > 0 else 0.0
        self.stage = "rest" if self.left else "ready"

    def _lead_on(self) -> None:
        """To the next game, the questions or the next block."""
        self.stage = "ready"
        if self.game == self.games:
            if self.block < 0 or not self.plan.questions:
                self._enter(self.block + 1)
            else:
                self.stage = "questions"

    def _follow(self, row: dict[str, Any]) -> None:
        """Go through what a line of the diary tells."""
        if row["kind"] == "game" and row["result"] != BROKEN:
            self.game += 1
            self._lead_on()
        elif row["kind"] == "answer":
            self._answers[row["question"]] = row["value"]
            if self._answers.keys() >= {q.id for q in self.plan.questions}:
                self._enter(self.block + 1)
