"""Session of a study: consent, practice, blocks of games, questions, breaks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.live_match import RATE
from marl_airhockey.study.admission import PARTICIPANT_SEAT, AdmissionSession
from marl_airhockey.study.course import BROKEN_OFF, Course
from marl_airhockey.study.opponents import seat_opponent
from marl_airhockey.study.pages import progress, seat_rows, texts
from marl_airhockey.study.people import Participant
from marl_airhockey.study.plan import Plan


class Study(AdmissionSession):
    """Session in which one participant after the other goes through a plan.

    Args:
        plan: of the study.
        folder: where it is kept.

    Raises:
        ValueError: an opponent that cannot play the plan's scenario.
    """

    ACCEPTED = {"hello", "aim", "stick", "start", "pause", "consent", "answer"} | {
        "withdraw",
        "next",
    }

    def __init__(self, plan: Plan, folder: Path) -> None:
        super().__init__(plan, folder)
        # Everything is played once, so that nothing is compiled in a session.
        opponents = list(plan.opponents)
        if opponents and plan.practice:
            opponents.insert(0, plan.practice_opponent)
        for opponent in opponents:
            seat_opponent(self.match, opponent)
            self.match.warm_up()
        if not opponents:
            self.match.warm_up()

    def _on_start(self, client: Client) -> None:
        participant = self.participant
        if participant is None or client.seat is None or self.free_seats:
            return
        course = participant.course
        if course.stage == "match":
            self.match.start()
        elif course.stage == "ready" and client.seat == PARTICIPANT_SEAT:
            assert self.recorder is not None
            course.begin()
            code, plan = participant.diary.code, self.plan.digest
            notes = {"participant": code, "plan": plan, **course.position}
            self.recorder.notes = notes
            self.match.start()

    def tick(self) -> None:
        """Advance the match and the participant's course by a tick."""
        super().tick()
        over = self.match.phase == "done"
        if over:
            self._dismiss_erased()
        if self.participant is None:
            return
        course = self.participant.course
        if course.stage == "match" and over:
            self._end_game(course)
        else:
            course.advance(1 / RATE)
        self._prepare()

    def _end_game(self, course: Course) -> None:
        """Note the game that is over."""
        match, recorder = self.match, self.recorder
        memory = {name: value[0] for name, value in match.world.memory.items()}
        course.end_game(
            self._result,
            score=match.world.scenario.caption(memory),
            seconds=round(match.ticks / RATE, 2),
            pauses=match.pauses,
            recording=recorder.path.name if recorder and recorder.path else "",
        )

    @property
    def _result(self) -> str:
        """Result of a game for the participant; a task is won by its success."""
        match = self.match
        if match.reason:
            return BROKEN_OFF
        if PARTICIPANT_SEAT in match.winners:
            return "won"
        contest = len({seat.team for seat in match.seats}) > 1
        return "drawn" if contest and not match.winners else "lost"

    def _on_answer(self, client: Client, question: str, value: int) -> None:
        person = self._person(client)
        if isinstance(person, Participant):
            person.course.answer(question, value)
            self._prepare()

    def describe(self) -> dict[str, Any]:
        """Return what a page gets once: the match and the texts of the study; JSON."""
        return {
            **self.match.describe(),
            "choices": [],
            "handicaps": [],
            "study": texts(self.plan),
        }

    def _status(self) -> dict[str, Any]:
        """Return what all pages get; of opponents only what the plan allows."""
        course = self.participant.course if self.participant else None
        seats = seat_rows(course, len(self.match.seats))
        return {**super()._status(), "seats": seats, "handicap": ""}

    def _own_fields(self, client: Client) -> dict[str, Any]:
        stage: dict[str, Any] = {"stage": self._stage(client)}
        person = self._person(client)
        if person is not None:
            stage["code"] = person.diary.code
        if isinstance(person, Participant):
            stage |= progress(person.course, bool(self.free_seats))
        return {**super()._own_fields(client), "study": stage}
