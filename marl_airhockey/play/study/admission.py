"""People of a study: admission, presence and erasure."""

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
"""Time after which a participant without a page has left the study, s."""
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
        """Person in the role of the participant's opponent."""
        self._erased: set[str] = set()
        """Keys of pages whose person has been erased."""
        self._seated_for: tuple[Course, int] | None = None
        """Course and block of the seated opponent; None without a participant."""

    def hello(self, client: Client, key: str) -> None:
        """Seat a page; resume the interrupted session of its person."""
        client.key = key
        if self.participant is None and key not in self._erased:
            self._resume(key)
        self.seat_people()
        if self._match.reason == GONE and not self._seats.free:
            self._match.start()

    def person(self, client: Client) -> Person | None:
        """Return the person of a page; None before the consent."""
        for person in (self.participant, self.partner):
            if person is not None and person.key == client.key:
                return person
        return None

    def seat_people(self) -> None:
        """Assign seats by role; only the first page of a person gets a seat."""
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
        """Admit the person of a page after the consent to a version of the texts.

        Raises:
            ValueError: The texts have changed, or the consent cannot be stored.
        """
        if version != self.plan.version:
            raise ValueError("the texts have changed; load the page again")
        if self.stage(client) != "consent" or not client.key:
            return
        role = "participant" if self.participant is None else "partner"
        try:
            diary = Diary.begin(self.folder, role, self.plan, client.key)
        except OSError as error:
            raise ValueError(f"data cannot be stored: {error.strerror}") from error
        now = time.monotonic()
        self._erased.discard(client.key)
        if self.participant is None:
            self._admit(client.key, diary)
        else:
            self.partner = Person(client.key, diary, now)
        self.seat_people()

    def _admit(self, key: str, diary: Diary) -> None:
        """Start with a participant, or resume at the end of the event log."""
        course = Course(self.plan, diary)
        self.participant = Participant(key, diary, time.monotonic(), course)
        self.recorder = Recorder(diary.folder)
        self.prepare()

    def prepare(self) -> None:
        """Set the opponent of the participant's block."""
        course = self.participant.course if self.participant else None
        wanted = (course, course.block) if course else None
        if wanted == self._seated_for:
            return
        self._seated_for = wanted
        if course and course.opponent:
            seat_opponent(self._match, course.opponent)
        self.seat_people()

    def _resume(self, key: str) -> None:
        """Resume an interrupted session from its event log."""
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
        """Dismiss people whose folder was deleted."""
        for person in (self.participant, self.partner):
            if person is not None and not person.diary.exists:
                self._dismiss(person)
                self._erased.add(person.key)

    def withdraw(self, client: Client) -> None:
        """Erase all data of the person of a page immediately."""
        person = self.person(client)
        if person is None:
            return
        self._dismiss(person)
        erase(self.folder, person.diary.code)
        self._erased.add(client.key)

    def next_person(self, client: Client) -> None:
        """Dismiss a participant who has completed the plan."""
        person = self.person(client)
        if isinstance(person, Participant) and person.at_end:
            self._dismiss(person)
        self._erased.discard(client.key)

    def _dismiss(self, person: Person) -> None:
        """End the participation of a person and abort a running game."""
        is_participant = person is self.participant
        if is_participant or self._match.drivers.names[PARTNER_SEAT] == PERSON:
            self._match.abort("a player has left")
            if self.recorder is not None:
                self.recorder.end(self._match, "a player has left")
        if is_participant:
            self.participant = self.recorder = None
            self._match.clear()  # The next participant must not see this score.
        else:
            self.partner = None
        self.seat_people()

    def check_presence(self, now: float) -> None:
        """Pause for people who are idle; dismiss people who are absent too long."""
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
        """Return the stage of a page's course, or consent, partner, busy or erased."""
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
