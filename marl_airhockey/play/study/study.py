"""Session of a study: consent, practice, blocks of games, questions and breaks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.play.client import Client
from marl_airhockey.play.host import Handler, Host
from marl_airhockey.play.live_match import RATE
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.session import Session
from marl_airhockey.play.study.admission import PARTICIPANT_SEAT, Admission
from marl_airhockey.play.study.course import BROKEN_OFF, Course
from marl_airhockey.play.study.opponents import open_match, seat_opponent
from marl_airhockey.play.study.pages import progress, seat_rows, texts
from marl_airhockey.play.study.people import Participant
from marl_airhockey.play.study.plan import Plan


def open_study(plan: Plan, folder: Path) -> Session:
    """Return a session in which one participant after the other follows a plan.

    Args:
        plan: Plan of the study.
        folder: Folder of the study.

    Raises:
        ValueError: An opponent cannot play the scenario of the plan.
    """
    return Session(Study(plan, folder, Seats(open_match(plan))))


class Study(Host):
    """Host that guides one participant after the other through a plan.

    Args:
        plan: Plan of the study.
        folder: Folder of the study.
        seats: Seats of the match.

    Raises:
        ValueError: An opponent cannot play the scenario of the plan.
    """

    def __init__(self, plan: Plan, folder: Path, seats: Seats) -> None:
        super().__init__(seats)
        self.plan, self.people = plan, Admission(plan, folder, seats)
        self._handlers: dict[str, Handler] = {
            "hello": self.people.hello,
            "aim": seats.aim,
            "stick": seats.stick,
            "start": self._start,
            "pause": self._pause,
            "consent": self.people.consent,
            "answer": self._answer,
            "comment": self._comment,
            "withdraw": self.people.withdraw,
            "next": self.people.next_person,
        }
        # Every opponent plays once, so that nothing is compiled during a session.
        opponents = list(plan.opponents)
        if opponents and plan.practice:
            opponents.insert(0, plan.practice_opponent)
        for opponent in opponents:
            seat_opponent(self.match, opponent)
            self.match.warm_up()
        if not opponents:
            self.match.warm_up()

    @property
    def handlers(self) -> Mapping[str, Handler]:
        return self._handlers

    @property
    def recorder(self) -> Recorder | None:
        return self.people.recorder

    def before_message(self) -> None:
        """Dismiss people who were erased, between games."""
        if self.match.phase not in ("play", "countdown"):
            self.people.dismiss_erased()

    def check_presence(self, now: float) -> None:
        """Pause for people who are idle; dismiss people who are absent too long."""
        self.people.check_presence(now)

    def _pause(self, client: Client) -> None:
        if self.seats.may_control(client):
            self.match.pause()

    def _start(self, client: Client) -> None:
        participant = self.people.participant
        if participant is None or client.seat is None or self.seats.free:
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

    def after_tick(self) -> None:
        """Advance the participant's course by a tick."""
        over = self.match.phase == "done"
        if over:
            self.people.dismiss_erased()
        if self.people.participant is None:
            return
        course = self.people.participant.course
        recorder = self.recorder
        if course.stage == "match" and recorder and recorder.runs and recorder.path:
            course.note_recording(recorder.path.name)
        if course.stage == "match" and over:
            self._end_game(course)
        else:
            course.advance(1 / RATE)
        self.people.prepare()

    def _end_game(self, course: Course) -> None:
        """Log the game that has ended."""
        match, recorder = self.match, self.recorder
        memory = {name: value[0] for name, value in match.world.memory.items()}
        scenario = match.world.scenario
        scores = {
            name: np.ravel(counts).tolist()
            for name, counts in scenario.scores(memory).items()
        }
        course.end_game(
            self._result,
            rule=scenario.decided_by(memory),
            score=str(scenario.caption(memory)),
            scores=scores,
            device=self.seats.devices[PARTICIPANT_SEAT],
            seconds=round(match.ticks / RATE, 2),
            pauses=match.pauses,
            recording=recorder.path.name if recorder and recorder.path else "",
        )

    @property
    def _result(self) -> str:
        """Result of a game for the participant; success in a task is a win."""
        match = self.match
        if match.reason:
            return BROKEN_OFF
        if PARTICIPANT_SEAT in match.winners:
            return "won"
        contest = len({seat.team for seat in match.seats}) > 1
        return "drawn" if contest and not match.winners else "lost"

    def _answer(self, client: Client, question: str, value: int) -> None:
        person = self.people.person(client)
        if isinstance(person, Participant):
            person.course.answer(question, value)
            self.people.prepare()

    def _comment(self, client: Client, question: str, text: str) -> None:
        person = self.people.person(client)
        if isinstance(person, Participant):
            person.course.comment(question, text)
            self.people.prepare()

    def describe(self) -> dict[str, Any]:
        """Return the JSON that a page receives once: the match and the texts."""
        return {
            **self.match.describe(),
            "ladder": [],
            "study": texts(self.plan),
        }

    def status(self) -> dict[str, Any]:
        """Return the data about opponents that the plan allows, for all pages."""
        participant = self.people.participant
        course = participant.course if participant else None
        seats = seat_rows(course, len(self.match.seats))
        status: dict[str, Any] = {"seats": seats}
        if participant and participant.diary.failure:
            status["not_recorded"] = participant.diary.failure
        return status

    def own_fields(self, client: Client) -> dict[str, Any]:
        stage: dict[str, Any] = {"stage": self.people.stage(client)}
        person = self.people.person(client)
        if person is not None:
            stage["code"] = person.diary.code
        if isinstance(person, Participant):
            stage |= progress(person.course, bool(self.seats.free))
        return {"study": stage}
