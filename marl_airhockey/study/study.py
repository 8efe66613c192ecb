"""A study at a court: consent, practice, blocks of games, questions, breaks."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marl_airhockey.play.live_match import PERSON, RATE, Court
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.session import GONE, GRACE, IDLE, Guest, Session
from marl_airhockey.study.archive import Diary, diaries, digest, erase
from marl_airhockey.study.course import BROKEN, Course
from marl_airhockey.study.plan import Opponent, Plan

ABSENT = 600.0
"""s after which a participant whose page is gone is held to have left."""
SUBJECT, PARTNER = 0, 1
"""Seats of the participant, and of a person whom the participant meets."""


@dataclass
class Person:
    """Somebody who has agreed to take part."""

    key: str
    """Of their page."""
    diary: Diary
    seen: float
    """When their page was last there."""


@dataclass
class Subject(Person):
    """The participant whose session runs."""

    course: Course


def open_court(plan: Plan) -> Court:
    """The court of a plan.

    Raises:
        ValueError: a plan that cannot be played, an opponent named.
    """
    court = Court(
        plan.scenario,
        {},
        {"backend": plan.backend, "profile": plan.profile, "options": plan.options},
    )
    seats = len(court.seats)
    if (seats == 1) != (not plan.opponents):
        needs = "no opponents" if seats == 1 else "opponents"
        raise ValueError(f"opponents: {plan.scenario} needs {needs}")
    if seats != 2 and PERSON in [opponent.name for opponent in plan.opponents]:
        raise ValueError("opponents: a person can be met in a game of two seats")
    for opponent in (plan.practice_opponent, *plan.opponents):
        invite(court, opponent)
    return court


def invite(court: Court, opponent: Opponent) -> None:
    """Give all seats but the participant's to an opponent."""
    court.hold_back(opponent.fairness)
    for i in range(1, len(court.seats)):
        court.seat(i, opponent.name)


class Study(Session):
    """A court at which one participant after the other goes through a plan.

    Args:
        plan: what is done.
        folder: where it is kept.

    Raises:
        ValueError: an opponent that cannot play the plan's scenario.
    """

    HEARS = {"hello", "aim", "stick", "start", "pause", "consent", "answer"} | {
        "withdraw",
        "next",
    }

    def __init__(self, plan: Plan, folder: Path) -> None:
        super().__init__(open_court(plan))
        self.plan, self.folder = plan, folder
        self.subject: Subject | None = None
        self.partner: Person | None = None
        self._erased: set[str] = set()
        self._met: tuple[Course, int] | None = None
        """For which block of whom the court is prepared."""
        # All that will be played once, so that nothing is compiled in a session.
        for opponent in (self._practice, *plan.opponents):
            if opponent is not None:
                invite(self.court, opponent)
            self.court.rehearse()

    @property
    def _wants_partner(self) -> bool:
        return any(opponent.name == PERSON for opponent in self.plan.opponents)

    @property
    def _practice(self) -> Opponent | None:
        plan = self.plan
        return plan.practice_opponent if plan.practice and plan.opponents else None

    # Who is there.

    def _on_hello(self, guest: Guest, key: str) -> None:
        guest.key = key
        if self.subject is None and key not in self._erased:
            self._resume(key)
        self._seat_people()
        if self.court.reason == GONE and not self.free:
            self.court.start()

    def _person(self, guest: Guest) -> Person | None:
        for person in (self.subject, self.partner):
            if person is not None and person.key == guest.key:
                return person
        return None

    def _seat_people(self) -> None:
        """Everybody to the seat of their part; of two equal pages the first one."""
        seats: dict[int, Guest] = {}
        for guest in sorted(self.guests, key=lambda g: g.seat is None):
            person = self._person(guest)
            seat = SUBJECT if person is self.subject else PARTNER
            if person is None or self.court.who[seat] != PERSON or seat in seats:
                guest.seat = None
                continue
            seats[seat] = guest
            guest.name, guest.consent = person.diary.code, self.plan.version
            if guest.seat is None:
                self._take(guest, seat)

    def _on_consent(self, guest: Guest, version: str) -> None:
        if version != self.plan.version:
            raise ValueError("these texts have changed: load the page again")
        if self._stage(guest) != "consent" or not guest.key:
            return
        role = "participant" if self.subject is None else "partner"
        diary = Diary.begin(self.folder, role, self.plan, guest.key)
        now = time.monotonic()
        self._erased.discard(guest.key)
        if self.subject is None:
            self._admit(guest.key, diary)
        else:
            self.partner = Person(guest.key, diary, now)
        self._seat_people()

    def _admit(self, key: str, diary: Diary) -> None:
        """Begin with a participant, or go on where the diary ends."""
        course = Course(self.plan, diary)
        self.subject = Subject(key, diary, time.monotonic(), course)
        self.recorder = Recorder(diary.folder)
        self._prepare()

    def _prepare(self) -> None:
        """Have the participant's opponent at the court."""
        course = self.subject.course if self.subject else None
        met = (course, course.block) if course else None
        if met == self._met:
            return
        self._met = met
        if course and course.opponent:
            invite(self.court, course.opponent)
        self._seat_people()

    def _resume(self, key: str) -> None:
        """Go on with a session that was cut off, by what its diary says."""
        if not self.folder.is_dir():
            return
        for diary in diaries(self.folder):
            head = diary.rows[0]
            known = head["page"] == digest(key) and head["plan"] == self.plan.digest
            if head["role"] == "participant" and known and not diary.over:
                self._admit(key, diary)
                return

    def hear(self, guest: Guest, text: str) -> None:
        if self.court.phase not in ("play", "countdown"):
            self._notice_erased()
        super().hear(guest, text)

    def _notice_erased(self) -> None:
        """People whose folder somebody has deleted are out."""
        for person in (self.subject, self.partner):
            if person is not None and not person.diary.there:
                self._close(person)
                self._erased.add(person.key)

    def _on_withdraw(self, guest: Guest) -> None:
        """Erase all that is kept of a person, now."""
        person = self._person(guest)
        if person is None:
            return
        self._close(person)
        erase(self.folder, person.diary.code)
        self._erased.add(guest.key)

    def _on_next(self, guest: Guest) -> None:
        """The session is over: the next participant may come."""
        subject = self._person(guest)
        if isinstance(subject, Subject) and subject.course.stage == "end":
            self._close(subject)
        self._erased.discard(guest.key)

    def _close(self, person: Person) -> None:
        """A person's part is over; a game that runs is broken off."""
        if person is self.subject or self.court.who[PARTNER] == PERSON:
            self.court.end("a player has left")
            if self.recorder is not None:
                self.recorder.end(self.court, "a player has left")
        if person is self.subject:
            self.subject = self.recorder = None
        else:
            self.partner = None
        self._seat_people()

    def _let_go(self, now: float) -> None:
        """Pause for people who are idle; end the part of those who stay away."""
        for guest in self.guests:
            person = self._person(guest)
            if person is not None:
                person.seen = now
            if guest.seat is not None and now - guest.moved > IDLE:
                self.court.pause("a player has been idle")
        self._notice_erased()
        for person in (self.subject, self.partner):
            if person is None:
                continue
            ended = isinstance(person, Subject) and person.course.stage == "end"
            if now - person.seen > (GRACE if ended else ABSENT):
                if not ended:
                    person.diary.write("end", reason="left")
                self._close(person)

    # What the participant goes through.

    def _on_start(self, guest: Guest) -> None:
        subject = self.subject
        if subject is None or guest.seat is None or self.free:
            return
        course = subject.course
        if course.stage == "match":
            self.court.start()
        elif course.stage == "ready" and guest.seat == SUBJECT:
            assert self.recorder is not None
            course.begin()
            code, plan = subject.diary.code, self.plan.digest
            self.recorder.notes = {"participant": code, "plan": plan, **course.place}
            self.court.start()

    def tick(self) -> None:
        """One step of the court, and of the participant's way."""
        super().tick()
        over = self.court.phase == "done"
        if over:
            self._notice_erased()
        if self.subject is None:
            return
        course = self.subject.course
        if course.stage == "match" and over:
            self._note_game(course)
        else:
            course.wait(1 / RATE)
        self._prepare()

    def _note_game(self, course: Course) -> None:
        court, recorder = self.court, self.recorder
        course.note(
            self._result,
            score=court.world.scenario.caption(
                {name: value[0] for name, value in court.world.memory.items()}
            ),
            seconds=round(court.ticks / RATE, 2),
            pauses=court.pauses,
            recording=recorder.path.name if recorder and recorder.path else "",
        )

    @property
    def _result(self) -> str:
        """How a game ended for the participant; a task is won by its success."""
        court = self.court
        if court.reason:
            return BROKEN
        if SUBJECT in court.winners:
            return "won"
        contest = len({seat.team for seat in court.seats}) > 1
        return "drawn" if contest and not court.winners else "lost"

    def _on_answer(self, guest: Guest, question: str, value: int) -> None:
        person = self._person(guest)
        if isinstance(person, Subject):
            person.course.answer(question, value)
            self._prepare()

    # What pages are told.

    def describe(self) -> dict[str, Any]:
        """The court, and the texts of the study."""
        plan = self.plan
        return {
            **self.court.describe(),
            "choices": [],
            "strengths": [],
            "study": {
                "title": plan.title,
                "version": plan.version,
                "information": plan.information.strip().split("\n\n"),
                "agree": plan.agree,
                "thanks": plan.thanks,
                "blocks": plan.blocks,
                "questions": [{**vars(q), "most": q.most} for q in plan.questions],
            },
        }

    def _around(self) -> dict[str, Any]:
        """Of opponents only what the plan lets participants know."""
        subject = self.subject
        name = subject.course.title if subject else ""
        others = [{"who": name, "taken": True, "title": name}]
        count = len(self.court.seats)
        return {
            **super()._around(),
            "seats": [{"who": PERSON, "taken": subject is not None}]
            + others * (count - 1),
            "strength": "",
        }

    def _stage(self, guest: Guest) -> str:
        """What a page shows: a stage, or consent, partner, busy, erased."""
        if guest.key in self._erased:
            return "erased"
        person = self._person(guest)
        if isinstance(person, Subject):
            return person.course.stage if guest.seat is not None else "busy"
        if person is not None:
            return "partner"
        partner = self._wants_partner and self.partner is None
        return "consent" if self.subject is None or partner else "busy"

    def _own(self, guest: Guest) -> dict[str, Any]:
        stage: dict[str, Any] = {"stage": self._stage(guest)}
        person = self._person(guest)
        if person is not None:
            stage["code"] = person.diary.code
        if isinstance(person, Subject):
            course = person.course
            stage |= {
                "block": course.block,
                "game": course.game,
                "games": course.games,
                "left": round(course.left),
                "waits": bool(self.free),
            }
        return {**super()._own(guest), "study": stage}
