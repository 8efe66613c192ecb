"""People at a court: who has which seat, what they say, what they are shown."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import secrets
import time
from typing import Any

from marl_airhockey.play.handicap import STRENGTHS
from marl_airhockey.play.live_match import PERSON, RATE, Court
from marl_airhockey.play.protocol import Meter, parse
from marl_airhockey.play.recorder import Recorder

IDLE = 60.0
"""s without a move after which a page lets go of its seat."""
GRACE = 10.0
"""s for which a seat is kept for a page that has gone, say to reload."""
GONE = "a player has gone"
BEHIND = 6
"""Ticks that the loop makes up for; what is more is let go."""


class Guest:
    """A page that is connected."""

    def __init__(self) -> None:
        self.name = secrets.token_hex(4)
        """Pseudonym: the same for all games of a page, known to nobody."""
        self.key = ""
        self.consent: str | None = None
        """Version of what they have agreed to, in a study."""
        self.seat: int | None = None
        self.seen = 0
        """Number of the last aim that the world has taken."""
        self.rtt: float | None = None
        self.moved = time.monotonic()
        self.meter = Meter(self.moved)
        self.place = (0.0, 0.0)
        self.news = asyncio.Event()
        self.frame = ""


class Session:
    """A court that runs in real time, and the guests around it."""

    HEARS = {"hello", "aim", "stick", "start", "pause", "stop", "swap", "sit"} | {
        "leave",
        "opponent",
        "strength",
    }
    """Kinds of messages that are taken."""

    def __init__(self, court: Court, recorder: Recorder | None = None) -> None:
        self.court, self.recorder = court, recorder
        self.guests: set[Guest] = set()
        self._kept: dict[str, tuple[int, float]] = {}
        self.rate = float(RATE)
        """Ticks a second, over the last second."""
        self._recorded: list[dict[str, Any]] = []
        self.failure: BaseException | None = None
        """Why the loop died, if it did."""

    def join(self) -> Guest:
        """Somebody has opened the page; the first free seat of people is theirs."""
        guest = Guest()
        self.guests.add(guest)
        return guest

    def part(self, guest: Guest) -> None:
        """A page has gone: its match waits, its seat is kept for a while."""
        self.guests.discard(guest)
        if guest.seat is not None:
            if guest.key:
                self._kept[guest.key] = (guest.seat, time.monotonic() + GRACE)
            self._leave(guest, GONE)

    def hear(self, guest: Guest, text: str) -> None:
        """Take a message.

        Raises:
            ValueError: one that no page of ours sends, or too many of them.
        """
        guest.meter.take(time.monotonic())
        kind, fields = parse(text)
        if kind not in self.HEARS:
            raise ValueError(f"{kind}: not at this table")
        getattr(self, f"_on_{kind}")(guest, **fields)

    def _on_hello(self, guest: Guest, key: str) -> None:
        guest.key, guest.name = key, hashlib.sha256(key.encode()).hexdigest()[:8]
        seat, _ = self._kept.pop(key, (None, 0.0))
        if seat is not None and seat in self.free:
            self._take(guest, seat)
            if self.court.reason == GONE and not self.free:
                self.court.start()
        elif guest.seat is None and self.free:
            self._take(guest, self.free[0])

    def _on_aim(self, guest: Guest, x: float, y: float, q: int, rtt: float) -> None:
        if guest.seat is None:
            return
        hand: Any = self.court.hand(guest.seat, "mouse")
        hand.aim(*self.court.ego(guest.seat, x, y))
        if (x, y) != guest.place:
            guest.place, guest.moved = (x, y), time.monotonic()
        guest.seen, guest.rtt = q, rtt if rtt > 0.0 else None

    def _on_stick(self, guest: Guest, x: float, y: float, q: int, rtt: float) -> None:
        if guest.seat is None:
            return
        hand: Any = self.court.hand(guest.seat, "gamepad")
        hand.push(*self.court.ego(guest.seat, x, y))
        if (x, y) != (0.0, 0.0):
            guest.moved = time.monotonic()
        guest.seen, guest.rtt = q, rtt if rtt > 0.0 else None

    def _on_start(self, guest: Guest) -> None:
        if self._may(guest) and not self.free:
            self.court.start()

    def _on_pause(self, guest: Guest) -> None:
        if self._may(guest):
            self.court.pause()

    def _on_stop(self, guest: Guest) -> None:
        if self._may(guest):
            self.court.end("broken off by a player")

    def _on_swap(self, guest: Guest) -> None:
        """Everybody moves on by one seat: in a duel, the ends change."""
        court = self.court
        if not self._may(guest) or court.phase not in ("lobby", "done"):
            return
        count, who = len(court.who), list(court.who)
        for i, name in enumerate(who):
            court.seat((i + 1) % count, name)
        for other in self.guests:
            if other.seat is not None:
                other.seat = (other.seat + 1) % count

    def _on_sit(self, guest: Guest, seat: int) -> None:
        if seat in self.free:
            if guest.seat is not None:
                self._leave(guest, "a player has changed seats")
            self._take(guest, seat)

    def _on_leave(self, guest: Guest) -> None:
        if guest.seat is not None:
            self._leave(guest, "a player has left")

    def _on_opponent(self, guest: Guest, seat: int, name: str) -> None:
        court, taken = self.court, [g.seat for g in self.guests]
        known = [*court.choices, PERSON]
        if not self._may(guest) or seat >= len(court.who) or seat in taken:
            return
        if name in known and court.phase in ("lobby", "done"):
            # What is offered fits; the rest is refused by the court.
            with contextlib.suppress(ValueError):
                court.seat(seat, name)

    def _on_strength(self, guest: Guest, name: str) -> None:
        court = self.court
        if self._may(guest) and name in STRENGTHS and court.phase in ("lobby", "done"):
            court.hold_back(STRENGTHS[name])

    def _may(self, guest: Guest) -> bool:
        """Whether a guest has a say: those with a seat, or all if programs play."""
        return guest.seat is not None or PERSON not in self.court.who

    @property
    def free(self) -> list[int]:
        """Seats of people that nobody has."""
        taken = {guest.seat for guest in self.guests}
        return [
            i
            for i, name in enumerate(self.court.who)
            if name == PERSON and i not in taken
        ]

    def _take(self, guest: Guest, seat: int) -> None:
        guest.seat, guest.moved = seat, time.monotonic()

    def _leave(self, guest: Guest, reason: str) -> None:
        assert guest.seat is not None
        hand: Any = self.court.hand(guest.seat, "mouse")
        hand.rest()
        guest.seat = None
        self.court.pause(reason)

    def _let_go(self, now: float) -> None:
        """Free the seats of idle pages, and those kept for pages that stay away."""
        for guest in self.guests:
            if guest.seat is not None and now - guest.moved > IDLE:
                self._leave(guest, "a player has been idle")
        self._kept = {k: v for k, v in self._kept.items() if v[1] > now}

    async def run(self) -> None:
        """Tick for ever, in real time."""
        due = time.perf_counter()
        mark, count = due, 0
        while True:
            self.tick()
            count += 1
            due += 1 / RATE
            now = time.perf_counter()
            if now - mark >= 1.0:
                self.rate, mark, count = count / (now - mark), now, 0
                self._let_go(time.monotonic())
            if now - due > BEHIND / RATE:
                due = now
            await asyncio.sleep(max(due - now, 0.0))

    def tick(self) -> None:
        """One step of the court, recorded and shown."""
        court = self.court
        moved = court.tick()
        if self.recorder is not None:
            self._record(self.recorder, moved)
        if self.guests:
            self._show()

    def _record(self, recorder: Recorder, moved: bool) -> None:
        court = self.court
        if moved and court.ticks == 1:
            self._recorded = self.players
            recorder.begin(court, self._recorded)
        if moved and self.players != self._recorded:
            recorder.end(court, "the players changed")
        elif moved:
            delays: list[float | None] = [None] * len(court.who)
            for guest in self.guests:
                if guest.seat is not None:
                    delays[guest.seat] = guest.rtt
            recorder.step(court, delays)
        if court.phase == "done":
            recorder.end(court, court.reason or "played to the end")

    @property
    def players(self) -> list[dict[str, Any]]:
        """Who sits at each seat."""
        people = {g.seat: (g.name, g.consent) for g in self.guests}
        rows = []
        for i, driver in enumerate(self.court.who):
            person, consent = people.get(i, (None, None))
            rows.append(
                {"seat": i, "driver": driver, "person": person, "consent": consent}
            )
        return rows

    def describe(self) -> dict[str, Any]:
        """What a page must know once, JSON."""
        return {
            **self.court.describe(),
            "choices": self.court.choices,
            "strengths": list(STRENGTHS),
        }

    def _show(self) -> None:
        """Put a new frame before every guest; one that was not fetched is dropped."""
        shared = {"t": "state", **self.court.state(), **self._around()}
        text = json.dumps(shared, separators=(",", ":"))[:-1]
        for guest in self.guests:
            own = json.dumps(self._own(guest), separators=(",", ":"))
            guest.frame = f"{text},{own[1:]}"
            guest.news.set()

    def _around(self) -> dict[str, Any]:
        """What is said of the people and programs around the court."""
        fairness = self.court.fairness
        return {
            "seats": [
                {"who": p["driver"], "taken": p["person"] is not None}
                for p in self.players
            ],
            "strength": next(
                (name for name, held in STRENGTHS.items() if held == fairness),
                fairness.words,
            ),
            "watching": sum(guest.seat is None for guest in self.guests),
            "rate": round(self.rate, 1),
            "recording": self.recorder is not None
            and self.court.phase in ("countdown", "play", "pause"),
        }

    def _own(self, guest: Guest) -> dict[str, Any]:
        """What is said to one guest alone."""
        return {"seat": guest.seat, "ack": guest.seen}
