"""A study at a court: consent, practice, blocks of games, questions, breaks."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from marl_airhockey.play.court import PERSON, RATE, Court
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.session import GONE, IDLE, Guest, Session
from marl_airhockey.study.archive import Diary, erase
from marl_airhockey.study.plan import Opponent, Plan

ABSENT = 600.0
"""s after which a participant whose page is gone is held to have left."""
VERDICT = 2.5
"""s for which the end of a game is shown before what comes next."""
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
        super().__init__(
            Court(
                plan.scenario,
                {},
                {
                    "backend": plan.backend,
                    "profile": plan.profile,
                    "options": plan.options,
                },
            )
        )
        self.plan, self.folder = plan, folder
        self.subject: Subject | None = None
        self.partner: Person | None = None
        self._erased: set[str] = set()
        self._clock = 0.0
        """s that the court has ticked."""
        self._check()

    def _check(self) -> None:
        """Every opponent once, so that none fails, or is compiled, in a session."""
        plan, seats = self.plan, len(self.court.seats)
        if (seats == 1) != (not plan.opponents):
            need = "no opponents" if seats == 1 else "opponents"
            raise ValueError(f"opponents: {plan.scenario} needs {need}")
        if self._wants_partner and seats != 2:
            raise ValueError("opponents: a person can be met in a game of two seats")
        for opponent in (self._practice, *plan.opponents):
            if opponent is not None:
                self._invite(opponent)
            self.court.rehearse()

    @property
    def _wants_partner(self) -> bool:
        return any(opponent.name == PERSON for opponent in self.plan.opponents)

    @property
    def _practice(self) -> Opponent | None:
        plan = self.plan
        return plan.practice_opponent if plan.practice and plan.opponents else None

    def _invite(self, opponent: Opponent) -> None:
        """Give all seats but the participant's to an opponent."""
        self.court.hold_back(opponent.fairness)
        for i in range(1, len(self.court.seats)):
            self.court.seat(i, opponent.name)

    # Who is there.

    def _on_hello(self, guest: Guest, key: str) -> None:
        guest.key = key
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
        diary, now = Diary(self.folder, role, self.plan), time.monotonic()
        self._erased.discard(guest.key)
        if self.subject is None:
            self.subject = Subject(guest.key, diary, now)
            self.recorder = Recorder(diary.folder)
            self._enter(-1 if self.plan.practice else 0)
        else:
            self.partner = Person(guest.key, diary, now)
        self._seat_people()

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
        for person in (self.subject, self.partner):
            if person is not None and now - person.seen > ABSENT:
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
            subject.diary.write("end", reason="complete")
            return
        opponent = self._opponent
        if opponent is not None:
            self._invite(opponent)
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
        return plan.opponents[subject.diary.order[subject.block]]

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
            self._note_game(subject)
        elif subject.stage == "over" and self._clock >= subject.until:
            self._lead_on(subject)
        elif subject.stage == "rest" and self._clock >= subject.until:
            subject.stage = "ready"

    def _note_game(self, subject: Subject) -> None:
        """A game is over; one that was broken off is played again."""
        subject.diary.write("game", **self._place(), result=self._result)
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
            return "broken off"
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
        others = [{"who": name, "taken": True, "title": name}]
        count = len(self.court.seats)
        return {
            **super()._around(),
            "seats": [{"who": PERSON, "taken": subject is not None}]
            + others * (count - 1),
            "strength": "",
            "recording": self.subject is not None,
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
