"""A study at a court: consent, practice, blocks of games, questions, breaks."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from marl_airhockey.play.court import PERSON, RATE, Court
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.session import GONE, GRACE, IDLE, Guest, Session
from marl_airhockey.study.archive import Diary, diaries, digest, erase
from marl_airhockey.study.plan import Opponent, Plan

ABSENT = 600.0
"""s after which a participant whose page is gone is held to have left."""
VERDICT = 2.5
"""s for which the end of a game is shown before what comes next."""
BROKEN = "broken off"
"""Result of a game that does not count."""
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

    stage: str = "ready"
    """ready, match, over, questions, rest, end"""
    block: int = -1
    """-1 is practice."""
    game: int = 0
    """Of the block: how many are over."""
    until: float = 0.0
    """When a rest, or the sight of a verdict, is over; by the clock of the study."""
    answers: dict[str, int] = field(default_factory=dict)


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
        need = "no opponents" if seats == 1 else "opponents"
        raise ValueError(f"opponents: {plan.scenario} needs {need}")
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
        self._clock = 0.0
        """s that the court has ticked."""
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
            self._admit(Subject(guest.key, diary, now))
            self._enter(self._first)
        else:
            self.partner = Person(guest.key, diary, now)
        self._seat_people()

    def _admit(self, subject: Subject) -> None:
        self.subject, self.recorder = subject, Recorder(subject.diary.folder)

    @property
    def _first(self) -> int:
        """The block with which all begins."""
        return -1 if self.plan.practice else 0

    def _resume(self, key: str) -> None:
        """Go on with a session that was cut off, by what its diary says."""
        if not self.folder.is_dir():
            return
        for diary in diaries(self.folder):
            head = diary.rows[0]
            known = head["page"] == digest(key) and head["plan"] == self.plan.digest
            if head["role"] == "participant" and known and not diary.over:
                self._admit(Subject(key, diary, time.monotonic()))
                self._enter(self._first)
                for row in list(diary.rows):
                    self._replay(row)

    def _replay(self, row: dict[str, Any]) -> None:
        """Follow a line of the diary."""
        subject = self.subject
        assert subject is not None
        if row["kind"] == "game" and row["result"] != BROKEN:
            subject.game += 1
            self._lead_on(subject)
        elif row["kind"] == "answer":
            subject.answers[row["question"]] = row["value"]
            if subject.answers.keys() >= {q.id for q in self.plan.questions}:
                self._enter(subject.block + 1)

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
        if isinstance(subject, Subject) and subject.stage == "end":
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
            ended = isinstance(person, Subject) and person.stage == "end"
            if now - person.seen > (GRACE if ended else ABSENT):
                if not ended:
                    person.diary.write("end", reason="left")
                self._close(person)

    # What the participant goes through.

    def _enter(self, block: int) -> None:
        """Begin a block; -1 is practice."""
        subject, plan = self.subject, self.plan
        assert subject is not None
        subject.block, subject.game, subject.answers = block, 0, {}
        if block == plan.blocks:
            subject.stage = "end"
            if not subject.diary.over:
                subject.diary.write("end", reason="complete")
            return
        opponent = self._opponent
        if opponent is not None:
            invite(self.court, opponent)
        subject.stage = "rest" if block > 0 and plan.rest > 0 else "ready"
        subject.until = self._clock + plan.rest
        self._seat_people()

    @property
    def _opponent(self) -> Opponent | None:
        """Whom the participant meets in this block; nobody in a game of one seat."""
        subject, plan = self.subject, self.plan
        if subject is None or not plan.opponents or subject.block == plan.blocks:
            return None
        if subject.block < 0:
            return plan.practice_opponent
        return plan.opponents[plan.sequence(subject.diary.number)[subject.block]]

    def _place(self) -> dict[str, Any]:
        """Where the participant is, for recordings and the diary."""
        subject, opponent = self.subject, self._opponent
        assert subject is not None
        return {
            "block": subject.block + 1,
            "game": subject.game + 1,
            "practice": subject.block < 0,
            "opponent": opponent.label if opponent else "",
        }

    def _on_start(self, guest: Guest) -> None:
        subject = self.subject
        if subject is None or guest.seat is None or self.free:
            return
        if subject.stage == "match":
            self.court.start()
        elif subject.stage == "ready" and guest.seat == SUBJECT:
            assert self.recorder is not None
            subject.stage = "match"
            self.recorder.notes = {
                "participant": subject.diary.code,
                "plan": self.plan.digest,
                **self._place(),
            }
            self.court.start()

    def tick(self) -> None:
        """One step of the court; a game, or a rest, that is over leads on."""
        super().tick()
        self._clock += 1 / RATE
        subject = self.subject
        if subject is None:
            return
        if subject.stage == "match" and self.court.phase == "done":
            self._notice_erased()
            self._note_game(subject)
        elif subject.stage == "over" and self._clock >= subject.until:
            self._lead_on(subject)
        elif subject.stage == "rest" and self._clock >= subject.until:
            subject.stage = "ready"

    def _note_game(self, subject: Subject) -> None:
        """A game is over; one that was broken off is played again."""
        if self.subject is None:
            return
        court, recorder = self.court, self.recorder
        subject.diary.write(
            "game",
            **self._place(),
            result=self._result,
            score=court.world.scenario.caption(
                {name: value[0] for name, value in court.world.memory.items()}
            ),
            seconds=round(court.ticks / RATE, 2),
            pauses=court.pauses,
            recording=recorder.path.name if recorder and recorder.path else "",
        )
        subject.game += not self.court.reason
        subject.stage, subject.until = "over", self._clock + VERDICT

    def _lead_on(self, subject: Subject) -> None:
        """To the next game, the questions or the next block."""
        practice, plan = subject.block < 0, self.plan
        subject.stage = "ready"
        if subject.game == (plan.practice if practice else plan.games):
            if practice or not plan.questions:
                self._enter(subject.block + 1)
            else:
                subject.stage = "questions"

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
        subject = self.subject
        asked = {q.id: q for q in self.plan.questions}
        if question not in asked or not 1 <= value <= asked[question].most:
            raise ValueError(f"answer: {question} {value} is not asked for")
        if subject is None or subject is not self._person(guest):
            return
        if subject.stage != "questions":
            return
        subject.answers[question] = value
        if subject.answers.keys() < asked.keys():
            return
        place = self._place()
        for name, answer in subject.answers.items():
            subject.diary.write(
                "answer",
                block=place["block"],
                opponent=place["opponent"],
                question=name,
                value=answer,
                choice=asked[name].choices[answer - 1] if asked[name].choices else "",
            )
        self._enter(subject.block + 1)

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
        opponent, subject = self._opponent, self.subject
        name = opponent.label if opponent else ""
        if subject is not None and self.plan.blind:
            name = "Practice" if subject.block < 0 else f"Opponent {subject.block + 1}"
            name = "" if opponent is None else name
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
            return person.stage if guest.seat is not None else "busy"
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
            most = self.plan.practice if person.block < 0 else self.plan.games
            stage |= {
                "block": person.block,
                "game": person.game,
                "games": most,
                "left": round(max(person.until - self._clock, 0.0)),
                "waits": bool(self.free),
            }
        return {**super()._own(guest), "study": stage}
