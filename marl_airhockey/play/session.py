"""People at a match: who has which seat, and what their pages ask for."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.handicap import PRESETS
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.match_loop import MatchLoop
from marl_airhockey.play.protocol import parse
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.recorder import Recorder

IDLE = 60.0
"""Time without a movement after which a page loses its seat, s."""
GRACE = 10.0
"""Time for which the seat of a page that has gone, say to reload, is reserved, s."""
LET_GO = 0.3
"""Time without news of a held pointer after which a real arm rests, s"""
GONE = "a player has gone"


@dataclass(frozen=True)
class Plant:
    """Plant behind a table, in which things can go wrong on demand."""

    faults: Mapping[str, str] = field(default_factory=dict)
    """Faults by name, in words"""
    switch: Callable[[str, bool], None] = lambda name, on: None
    """Switches one on or off"""


class Session(MatchLoop):
    """Match in real time to which pages connect, take seats and send messages."""

    ACCEPTED = {"hello", "aim", "stick", "start", "pause", "stop", "swap", "sit"} | {
        "leave",
        "opponent",
        "handicap",
        "fault",
    }
    """Kinds of messages that pages may send."""

    def __init__(self, match: LiveMatch, recorder: Recorder | None = None) -> None:
        super().__init__(match, recorder)
        self._reserved: dict[str, tuple[int, float]] = {}
        """Seat, and time until which it is reserved, by key of a page."""
        self.plant = Plant()
        """What pages may let go wrong, of a virtual lab."""

    @property
    def free_seats(self) -> list[int]:
        """Seats for people that nobody has taken."""
        taken = {client.seat for client in self.clients}
        names = enumerate(self.match.drivers.names)
        return [i for i, name in names if name == PERSON and i not in taken]

    def connect(self, remote: bool = False) -> Client:
        """Add a page; it gets a seat when it has said hello.

        Args:
            remote: True for one on another machine.
        """
        client = Client()
        # A real arm takes motion from its own machine alone; all others watch.
        client.watches = remote and isinstance(self.match, RealMatch)
        self.clients.add(client)
        return client

    def disconnect(self, client: Client) -> None:
        """Remove a page: pause its match and reserve its seat for `GRACE`."""
        self.clients.discard(client)
        if client.seat is not None:
            if client.key:
                self._reserved[client.key] = (client.seat, time.monotonic() + GRACE)
            self._leave(client, GONE)

    def receive(self, client: Client, text: str) -> None:
        """Handle a message.

        Raises:
            ValueError: one that no page of ours sends, or too many of them.
        """
        client.limiter.acquire(time.monotonic())
        kind, fields = parse(text)
        if kind not in self.ACCEPTED:
            raise ValueError(f"{kind}: not at this table")
        if client.watches:
            return
        getattr(self, f"_on_{kind}")(client, **fields)

    # Handlers of messages, by kind.

    def _on_hello(self, client: Client, key: str) -> None:
        client.key, client.name = key, hashlib.sha256(key.encode()).hexdigest()[:8]
        seat, _ = self._reserved.pop(key, (None, 0.0))
        if seat is not None and seat in self.free_seats:
            self._take(client, seat)
            if self.match.reason == GONE and not self.free_seats:
                self.match.start()
        elif client.seat is None and self.free_seats:
            self._take(client, self.free_seats[0])

    def _on_aim(
        self, client: Client, x: float, y: float, held: int, q: int, rtt: float
    ) -> None:
        if client.seat is None:
            return
        mouse: Any = self.match.drivers.input_device(client.seat, "mouse")
        if held:
            client.last_held = time.monotonic()
        if held or not isinstance(self.match, RealMatch):
            mouse.aim(*self.match.to_ego(client.seat, x, y))
        else:
            mouse.rest()
        if (x, y) != client.pointer:
            client.pointer, client.last_input = (x, y), time.monotonic()
        client.acknowledged, client.round_trip = q, rtt if rtt > 0.0 else None

    def _on_stick(self, client: Client, x: float, y: float, q: int, rtt: float) -> None:
        if client.seat is None:
            return
        gamepad: Any = self.match.drivers.input_device(client.seat, "gamepad")
        gamepad.push(*self.match.to_ego(client.seat, x, y))
        client.last_held = time.monotonic()
        if (x, y) != (0.0, 0.0):
            client.last_input = time.monotonic()
        client.acknowledged, client.round_trip = q, rtt if rtt > 0.0 else None

    def _on_start(self, client: Client) -> None:
        if self._may_control(client) and not self.free_seats:
            self.match.start()

    def _on_pause(self, client: Client) -> None:
        if self._may_control(client):
            self.match.pause()

    def _on_stop(self, client: Client) -> None:
        if self._may_control(client):
            self.match.abort("broken off by a player")

    def _on_swap(self, client: Client) -> None:
        """Move everybody on by one seat: in a duel, the ends change."""
        match = self.match
        if not self._may_control(client) or match.phase not in ("lobby", "done"):
            return
        names = list(match.drivers.names)
        for i, name in enumerate(names):
            match.set_driver((i + 1) % len(names), name)
        for other in self.clients:
            if other.seat is not None:
                other.seat = (other.seat + 1) % len(names)

    def _on_sit(self, client: Client, seat: int) -> None:
        if seat in self.free_seats:
            if client.seat is not None:
                self._leave(client, "a player has changed seats")
            self._take(client, seat)

    def _on_leave(self, client: Client) -> None:
        if client.seat is not None:
            self._leave(client, "a player has left")

    def _on_opponent(self, client: Client, seat: int, name: str) -> None:
        match, taken = self.match, [c.seat for c in self.clients]
        drivers = match.drivers
        if not self._may_control(client):
            return
        if seat >= len(drivers.names) or seat in taken:
            return
        if name in [*drivers.choices, PERSON] and match.phase in ("lobby", "done"):
            # What is offered fits; the match refuses the rest.
            with contextlib.suppress(ValueError):
                match.set_driver(seat, name)

    def _on_handicap(self, client: Client, name: str) -> None:
        between_matches = self.match.phase in ("lobby", "done")
        if self._may_control(client) and name in PRESETS and between_matches:
            with contextlib.suppress(ValueError):
                self.match.set_handicap(PRESETS[name])

    def _on_fault(self, client: Client, name: str, on: int) -> None:
        if name in self.plant.faults:
            self.plant.switch(name, bool(on))

    def describe(self) -> dict[str, Any]:
        return {
            **super().describe(),
            "camera": isinstance(self.match, RealMatch),
            "faults": dict(self.plant.faults),
        }

    def _may_control(self, client: Client) -> bool:
        """Return True for pages with a seat, and for all if only programs play."""
        return client.seat is not None or PERSON not in self.match.drivers.names

    def _take(self, client: Client, seat: int) -> None:
        client.seat, client.last_input = seat, time.monotonic()

    def _leave(self, client: Client, reason: str) -> None:
        """Take a page's seat away and pause the match."""
        assert client.seat is not None
        mouse: Any = self.match.drivers.input_device(client.seat, "mouse")
        mouse.rest()
        client.seat = None
        self.match.pause(reason)

    def _check_hands(self, now: float) -> None:
        """Let an arm rest whose person holds nothing, or is not heard any more."""
        drivers = self.match.drivers
        for client in self.clients:
            if client.seat is not None and now - client.last_held > LET_GO:
                kind = drivers.kind_of_device(client.seat)
                device: Any = drivers.input_device(client.seat, kind)
                device.rest()

    def _check_presence(self, now: float) -> None:
        """Free the seats of idle pages, and drop reservations that have expired."""
        for client in self.clients:
            if client.seat is not None and now - client.last_input > IDLE:
                self._leave(client, "a player has been idle")
        self._reserved = {k: v for k, v in self._reserved.items() if v[1] > now}
