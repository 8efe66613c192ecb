"""Course of a participant: practice, blocks of games, questions and breaks."""

from __future__ import annotations

from typing import Any

from marl_airhockey.play.study.archive import Diary
from marl_airhockey.play.study.plan import Opponent, Plan

RESULT_SHOWN = 2.5
"""Time for which the result of a game is shown, s."""
BROKEN_OFF = "broken off"
"""Result of an aborted game, which does not count."""


class Course:
    """Position of a participant in a plan, which resumes at the end of the event log.

    Args:
        plan: Plan of the study.
        diary: Event log of the participant.
    """

    def __init__(self, plan: Plan, diary: Diary) -> None:
        self.plan, self.diary = plan, diary
        self.stage = "ready"
        """One of: ready, match, over, questions, rest, end."""
        self._recording = ""
        self.time_left = 0.0
        """Remaining time of a break, or of the display of a result, s."""
        self.block = 0
        """Index of the block; -1 for practice."""
        self.game = 0
        """Number of completed games of this block."""
        self._answers: dict[str, int | str] = {}
        self._begin_block(-1 if plan.practice else 0)
        for row in list(diary.rows):
            self._replay(row)

    @property
    def games(self) -> int:
        """Number of games of this block."""
        return self.plan.practice if self.block < 0 else self.plan.games

    @property
    def opponent(self) -> Opponent | None:
        """Opponent of this block; None in a game with one seat, and at the end."""
        plan, block = self.plan, self.block
        if not plan.opponents or block == plan.blocks:
            return None
        if block < 0:
            return plan.practice_opponent
        return plan.opponents[plan.sequence(self.diary.number)[block]]

    @property
    def title(self) -> str:
        """Name of the opponent that the participant sees."""
        if self.opponent is None:
            return ""
        if not self.plan.blind:
            return self.opponent.label
        return "Practice" if self.block < 0 else f"Opponent {self.block + 1}"

    @property
    def position(self) -> dict[str, Any]:
        """Position in the plan for recordings and the event log, counted from 1."""
        return {
            "block": self.block + 1,
            "game": self.game + 1,
            "practice": self.block < 0,
            "opponent": self.opponent.label if self.opponent else "",
        }

    def begin(self) -> None:
        """Start the next game of the block."""
        self.diary.write("begin", **self.position)
        self.stage, self._recording = "match", ""

    def note_recording(self, name: str) -> None:
        """Log the recording of the running game, in case of a crash."""
        if name != self._recording:
            self._recording = name
            self.diary.write("recording", recording=name)

    def end_game(self, result: str, **facts: Any) -> None:
        """Log the end of a game; an aborted game is played again."""
        self.diary.write("game", **self.position, result=result, **facts)
        self.game += result != BROKEN_OFF
        self.stage, self.time_left = "over", RESULT_SHOWN

    def advance(self, seconds: float) -> None:
        """Advance the clock, which ends the display of a result and a break."""
        self.time_left = max(self.time_left - seconds, 0.0)
        if self.time_left == 0.0 and self.stage == "over":
            self._next_stage()
        elif self.time_left == 0.0 and self.stage == "rest":
            self.stage = "ready"

    def answer(self, question: str, value: int) -> None:
        """Store an answer; the last answer ends the block.

        Raises:
            ValueError: The plan does not have this question or value.
        """
        questions = {q.id: q for q in self.plan.questions}
        if question not in questions or not 1 <= value <= questions[question].largest:
            raise ValueError(f"answer: {question} {value} is not in the plan")
        self._take(question, value)

    def comment(self, question: str, text: str) -> None:
        """Store an answer to a free question, which may be empty.

        Raises:
            ValueError: The plan does not have this free question.
        """
        if question not in [q.id for q in self.plan.questions if q.free]:
            raise ValueError(f"comment: {question} is not in the plan")
        self._take(question, text.strip())

    def _take(self, question: str, answer: int | str) -> None:
        """Store an answer; after the last one, log all and start the next block."""
        if self.stage != "questions":
            return
        self._answers[question] = answer
        questions = {q.id: q for q in self.plan.questions}
        if self._answers.keys() < questions.keys():
            return
        position = self.position
        for name, given in self._answers.items():
            choices = questions[name].choices
            words = isinstance(given, str)
            self.diary.write(
                "answer",
                block=position["block"],
                opponent=position["opponent"],
                question=name,
                value=None if words else given,
                choice=choices[int(given) - 1] if choices else "",
                text=given if words else "",
            )
        self._begin_block(self.block + 1)

    def _begin_block(self, block: int) -> None:
        """Start a block; -1 is practice."""
        self.block, self.game, self._answers = block, 0, {}
        if block == self.plan.blocks:
            self.stage = "end"
            if not self.diary.ended:
                self.diary.write("end", reason="complete")
            return
        self.time_left = self.plan.rest if block > 0 else 0.0
        self.stage = "rest" if self.time_left else "ready"

    def _next_stage(self) -> None:
        """Start the next game, the questions or the next block."""
        self.stage = "ready"
        if self.game == self.games:
            if self.block < 0 or not self.plan.questions:
                self._begin_block(self.block + 1)
            else:
                self.stage = "questions"

    def _replay(self, row: dict[str, Any]) -> None:
        """Apply a row of the event log."""
        if row["kind"] == "game" and row["result"] != BROKEN_OFF:
            self.game += 1
            self._next_stage()
        elif row["kind"] == "answer":
            given = row["value"]
            self._answers[row["question"]] = row["text"] if given is None else given
            if self._answers.keys() >= {q.id for q in self.plan.questions}:
                self._begin_block(self.block + 1)
