"""Open table: a match at which everybody with the page can take a seat."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.handicap import PRESETS
from marl_airhockey.play.host import GONE, GRACE, Handler, Host
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.session import Session


@dataclass(frozen=True)
class Plant:
    """Plant behind a table, in which faults can be switched on."""

    faults: Mapping[str, str] = field(default_factory=dict)
    """Descriptions of the faults, by name"""
    switch: Callable[[str, bool], None] = lambda name, on: None
    """Function that switches one on or off"""


def open_table(
    match: LiveMatch, recorder: Recorder | None = None, plant: Plant | None = None
) -> Session:
    """Return a session in which everybody can take a free seat.

    Args:
        match: Match.
        recorder: Recorder of the episodes; None for none.
        plant: Plant whose faults pages may switch, of a virtual lab.
    """
    return Session(OpenTable(Seats(match), recorder, plant or Plant()))


class OpenTable(Host):
    """Host that gives a free seat to every page.

    Args:
        seats: Seats of the match.
        recorder: Recorder of the episodes; None for none.
        plant: Plant whose faults pages may switch.
    """

    def __init__(self, seats: Seats, recorder: Recorder | None, plant: Plant) -> None:
        super().__init__(seats)
        self._recorder, self.plant = recorder, plant
        self._reserved: dict[str, tuple[int, float]] = {}
        """Seat, and time until which it is reserved, by key of a page."""
        self._handlers: dict[str, Handler] = {
            "hello": self._hello,
            "aim": seats.aim,
            "stick": seats.stick,
            "start": self._start,
            "pause": self._pause,
            "stop": self._stop,
            "swap": self._swap,
            "sit": self._sit,
            "leave": self._leave,
            "opponent": self._opponent,
            "handicap": self._handicap,
            "fault": self._fault,
        }

    @property
    def handlers(self) -> Mapping[str, Handler]:
        return self._handlers

    @property
    def recorder(self) -> Recorder | None:
        return self._recorder

    def describe(self) -> dict[str, Any]:
        return {
            **self.match.describe(),
            "choices": self.match.drivers.choices,
            "handicaps": list(PRESETS),
            "camera": isinstance(self.match, RealMatch),
            "faults": dict(self.plant.faults),
        }

    def disconnected(self, client: Client) -> None:
        """Free the seat of a page that has gone, and reserve it for `GRACE`."""
        if client.seat is not None and client.key:
            self._reserved[client.key] = (client.seat, time.monotonic() + GRACE)
        super().disconnected(client)

    def check_presence(self, now: float) -> None:
        """Free the seats of idle pages, and drop reservations that have expired."""
        for client in self.seats.clients:
            if self.seats.is_idle(client, now):
                self.seats.leave(client, "a player has been idle")
        self._reserved = {k: v for k, v in self._reserved.items() if v[1] > now}

    def _hello(self, client: Client, key: str) -> None:
        seats = self.seats
        client.key, client.name = key, hashlib.sha256(key.encode()).hexdigest()[:8]
        seat, _ = self._reserved.pop(key, (None, 0.0))
        if seat is not None and seat in seats.free:
            seats.take(client, seat)
            if self.match.reason == GONE and not seats.free:
                self.match.start()
        elif client.seat is None and seats.free:
            seats.take(client, seats.free[0])

    def _start(self, client: Client) -> None:
        if self.seats.may_control(client) and not self.seats.free:
            self.match.start()

    def _pause(self, client: Client) -> None:
        if self.seats.may_control(client):
            self.match.pause()

    def _stop(self, client: Client) -> None:
        if self.seats.may_control(client):
            self.match.abort("broken off by a player")

    @property
    def _between_matches(self) -> bool:
        return self.match.phase in ("lobby", "done")

    def _swap(self, client: Client) -> None:
        """Move everybody to the next seat: in a duel, the ends change."""
        if not self.seats.may_control(client) or not self._between_matches:
            return
        names = list(self.match.drivers.names)
        for i, name in enumerate(names):
            self.match.set_driver((i + 1) % len(names), name)
        for other in self.seats.clients:
            if other.seat is not None:
                other.seat = (other.seat + 1) % len(names)

    def _sit(self, client: Client, seat: int) -> None:
        if seat in self.seats.free:
            if client.seat is not None:
                self.seats.leave(client, "a player has changed seats")
            self.seats.take(client, seat)

    def _leave(self, client: Client) -> None:
        if client.seat is not None:
            self.seats.leave(client, "a player has left")

    def _opponent(self, client: Client, seat: int, name: str) -> None:
        drivers, taken = self.match.drivers, [c.seat for c in self.seats.clients]
        if not self.seats.may_control(client):
            return
        if seat >= len(drivers.names) or seat in taken:
            return
        if name in [*drivers.choices, PERSON] and self._between_matches:
            # What is offered fits; the match refuses the rest.
            with contextlib.suppress(ValueError):
                self.match.set_driver(seat, name)

    def _handicap(self, client: Client, name: str) -> None:
        allowed = self.seats.may_control(client) and self._between_matches
        if allowed and name in PRESETS:
            with contextlib.suppress(ValueError):
                self.match.set_handicap(PRESETS[name])

    def _fault(self, client: Client, name: str, on: int) -> None:
        if name in self.plant.faults:
            self.plant.switch(name, bool(on))
