"""People of a study: who may take part, who is present, who is erased."""

from __future__ import annotations

import time
from pathlib import Path

from marl_airhockey.play.client import Client
from marl_airhockey.play.host import GONE, GRACE
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.study.archive import Diary, diaries, erase, page_digest
from marl_airhockey.play.study.course import Course
from marl_airhockey.play.study.opponents import seat_opponent
from marl_airhockey.play.study.people import Participant, Person
from marl_airhockey.play.study.plan import Plan

ABSENT = 600.0
"""Time after which a participant whose page is gone counts as having left, s."""
PARTICIPANT_SEAT, PARTNER_SEAT = 0, 1


class Admission:
    """People of a study and their seats, which they get after their consent.

    Args:
        plan: Plan of the study.
        folder: Folder of the study.
        seats: Seats of the match.
    """

    def __init__(self, plan: Plan, folder: Path, seats: Seats) -> None:
        self.plan, self.folder = plan, folder
        self._seats, self._match = seats, seats.match
        self.recorder: Recorder | None = None
        """Recorder of the participant's games; None without a participant."""
        self.participant: Participant | None = None
        self.partner: Person | None = None
        """Person who plays as the participant's opponent."""
        self._erased: set[str] = set()
        """Keys of pages whose person has been erased."""
        self._seated_for: tuple[Course, int] | None = None
        """Course and block whose opponent is seated; None for nobody's."""

    def hello(self, client: Client, key: str) -> None:
        """Seat a page; resume the interrupted session of its person."""
        client.key = key
        if self.participant is None and key not in self._erased:
            self._resume(key)
        self.seat_people()
        if self._match.reason == GONE and not self._seats.free:
            self._match.start()

    def person(self, client: Client) -> Person | None:
        """Return the person at a page; None for somebody who has not agreed."""
        for person in (self.participant, self.partner):
            if person is not None and person.key == client.key:
                return person
        return None

    def seat_people(self) -> None:
        """Give everybody the seat of their role; of two pages of a person the first."""
        seats: dict[int, Client] = {}
        for client in sorted(self._seats.clients, key=lambda c: c.seat is None):
            person = self.person(client)
            seat = PARTICIPANT_SEAT if person is self.participant else PARTNER_SEAT
            for_people = self._match.drivers.names[seat] == PERSON
            if person is None or not for_people or seat in seats:
                client.seat = None
                continue
            seats[seat] = client
            client.name, client.consent = person.diary.code, self.plan.version
            if client.seat is None:
                self._seats.take(client, seat)

    def consent(self, client: Client, version: str) -> None:
        """Admit the person at a page, who has agreed to the texts of a version.

        Raises:
            ValueError: The texts have changed since.
        """
        if version != self.plan.version:
            raise ValueError("these texts have changed: load the page again")
        if self.stage(client) != "consent" or not client.key:
            return
        role = "participant" if self.participant is None else "partner"
        try:
            diary = Diary.begin(self.folder, role, self.plan, client.key)
        except OSError as error:
            raise ValueError(f"nothing can be saved: {error.strerror}") from error
        now = time.monotonic()
        self._erased.discard(client.key)
        if self.participant is None:
            self._admit(client.key, diary)
        else:
            self.partner = Person(client.key, diary, now)
        self.seat_people()

    def _admit(self, key: str, diary: Diary) -> None:
        """Begin with a participant, or resume where the diary ends."""
        course = Course(self.plan, diary)
        self.participant = Participant(key, diary, time.monotonic(), course)
        self.recorder = Recorder(diary.folder)
        self.prepare()

    def prepare(self) -> None:
        """Seat the opponent of the participant's block."""
        course = self.participant.course if self.participant else None
        wanted = (course, course.block) if course else None
        if wanted == self._seated_for:
            return
        self._seated_for = wanted
        if course and course.opponent:
            seat_opponent(self._match, course.opponent)
        self.seat_people()

    def _resume(self, key: str) -> None:
        """Resume a session that was cut off, from its diary."""
        if not self.folder.is_dir():
            return
        for diary in diaries(self.folder):
            head = diary.rows[0]
            known = (
                head["page"] == page_digest(key) and head["plan"] == self.plan.digest
            )
            if head["role"] == "participant" and known and not diary.ended:
                self._admit(key, diary)
                return

    def dismiss_erased(self) -> None:
        """Dismiss people whose folder somebody has deleted."""
        for person in (self.participant, self.partner):
            if person is not None and not person.diary.exists:
                self._dismiss(person)
                self._erased.add(person.key)

    def withdraw(self, client: Client) -> None:
        """Erase all data of the person at a page, immediately."""
        person = self.person(client)
        if person is None:
            return
        self._dismiss(person)
        erase(self.folder, person.diary.code)
        self._erased.add(client.key)

    def next_person(self, client: Client) -> None:
        """Dismiss a participant who has come to the end."""
        person = self.person(client)
        if isinstance(person, Participant) and person.at_end:
            self._dismiss(person)
        self._erased.discard(client.key)

    def _dismiss(self, person: Person) -> None:
        """End a person's part; a game that runs is broken off."""
        is_participant = person is self.participant
        if is_participant or self._match.drivers.names[PARTNER_SEAT] == PERSON:
            self._match.abort("a player has left")
            if self.recorder is not None:
                self.recorder.end(self._match, "a player has left")
        if is_participant:
            self.participant = self.recorder = None
            self._match.clear()  # The next participant sees no score of this one.
        else:
            self.partner = None
        self.seat_people()

    def check_presence(self, now: float) -> None:
        """Pause for people who are idle; dismiss those who stay away."""
        for client in self._seats.clients:
            person = self.person(client)
            if person is not None:
                person.last_seen = now
                person.diary.flush()
            if self._seats.is_idle(client, now):
                self._match.pause("a player has been idle")
        self.dismiss_erased()
        for person in (self.participant, self.partner):
            if person is None:
                continue
            at_end = isinstance(person, Participant) and person.at_end
            if now - person.last_seen > (GRACE if at_end else ABSENT):
                if not at_end:
                    person.diary.write("end", reason="left")
                self._dismiss(person)

    def stage(self, client: Client) -> str:
        """Return the stage of a course, or: consent, partner, busy, erased."""
        if client.key in self._erased:
            return "erased"
        person = self.person(client)
        if isinstance(person, Participant):
            return person.course.stage if client.seat is not None else "busy"
        if person is not None:
            return "partner"
        names = [opponent.name for opponent in self.plan.opponents]
        partner_missing = PERSON in names and self.partner is None
        return "consent" if self.participant is None or partner_missing else "busy"
