"""Session: a match in real time that is recorded and sent to connected pages."""

from __future__ import annotations

import asyncio
import json
import time
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.host import Host
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.protocol import parse
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.sim.core.recording import PLAYED

BEHIND = 6
"""Largest number of ticks that a delayed loop catches up; others are skipped."""
EVENTS = 20
"""Largest number of events of a frame."""
ASIDE = 0.1
"""Time after which pages receive a frame while a real table is not ready, s."""


class Session:
    """Session to which pages connect and send messages.

    Args:
        host: Host with the match, which defines what pages may do.
    """

    def __init__(self, host: Host) -> None:
        self.host, self._seats = host, host.seats
        self.rate = float(RATE)
        """Number of ticks in the last second, 1/s."""
        self._recorded: list[dict[str, Any]] = []
        """Value of `Seats.players` at the start of the recording of this episode."""
        self._frames = 0
        self.failure: BaseException | None = None
        """Exception that ended the loop, if any."""

    @property
    def match(self) -> LiveMatch:
        """Match of the session now."""
        return self.host.match

    @property
    def clients(self) -> set[Client]:
        """Connected pages."""
        return self._seats.clients

    def connect(self, remote: bool = False) -> Client:
        """Add a page; it gets a seat after its message "hello".

        Args:
            remote: True for a page on another machine.
        """
        client = Client()
        # Only pages on the same machine can move a real arm; other pages watch.
        client.watches = remote and isinstance(self.match, RealMatch)
        self.clients.add(client)
        return client

    def disconnect(self, client: Client) -> None:
        """Remove a page and pause its match."""
        self.clients.discard(client)
        self.host.disconnected(client)

    def receive(self, client: Client, text: str) -> None:
        """Handle a message.

        Raises:
            ValueError: The message is invalid, or the page sends too many messages.
        """
        self.host.before_message()
        client.limiter.acquire(time.monotonic())
        kind, fields = parse(text)
        handlers = self.host.handlers
        if kind == "seen":
            client.link.acknowledge(fields["f"], time.monotonic())
        elif kind == "device":
            client.device = fields
        elif kind not in handlers:
            raise ValueError(f"{kind}: this table does not accept this message")
        elif not client.watches:
            handlers[kind](client, **fields)

    def describe(self) -> dict[str, Any]:
        """Return the JSON that a page receives once per edition of the host."""
        return self.host.describe()

    async def run(self) -> None:
        """Run the loop of ticks in real time, without end."""
        due = time.perf_counter()
        mark, count = due, 0
        while True:
            if isinstance(self.match, RealMatch):
                await self._tick_aside(self.match)
            else:
                self.tick()
            count += 1
            due += 1 / RATE
            now = time.perf_counter()
            if now - mark >= 1.0:
                self.rate, mark, count = count / (now - mark), now, 0
                self.host.check_presence(time.monotonic())
            if now - due > BEHIND / RATE:
                due = now
            await asyncio.sleep(max(due - now, 0.0))

    def tick(self) -> None:
        """Advance the match by a tick, record it and send it to all pages."""
        self._share(self.match.tick())

    async def _tick_aside(self, match: RealMatch) -> None:
        """Advance a match on a real table in a thread, because this can take long."""
        match.watched = bool(self.clients)
        self._seats.rest_unheld(time.monotonic())
        ticking = asyncio.ensure_future(asyncio.to_thread(match.tick))
        while not (await asyncio.wait({ticking}, timeout=ASIDE))[0]:
            self._broadcast()
        self._share(ticking.result())

    def _share(self, moved: bool) -> None:
        """Record a tick and send it to all pages."""
        recorder = self.host.recorder
        if recorder is not None:
            self._record(recorder, moved)
        if self.clients:
            self._broadcast()
        self.host.after_tick()

    def _record(self, recorder: Recorder, moved: bool) -> None:
        """Record the tick; a match whose players change ends the recording."""
        match, players = self.match, self._seats.players
        if moved and match.ticks == 1:
            self._recorded = players
            recorder.begin(match, players, self._seats.devices)
        if moved and players != self._recorded:
            recorder.end(match, "the players changed")
        elif moved:
            recorder.step(match, **self._seats.columns)
        if match.phase == "done":
            recorder.end(match, match.reason or PLAYED)

    def _broadcast(self) -> None:
        """Set the newest frame of every page; it replaces a frame that was not sent."""
        status = {**self._status(), **self.host.status()}
        self._frames += 1
        shared = {"t": "state", "f": self._frames, **self.match.state(), **status}
        events = shared.pop("events")
        text = json.dumps(shared, separators=(",", ":"))[:-1]
        for client in self.clients:
            client.events = [*client.events, *events][-EVENTS:]
            link = {"rate": client.link.rate, "ms": round(1e3 * client.link.delay)}
            fields = {
                "seat": client.seat,
                "ack": client.acknowledged,
                "link": link,
                "events": client.events,
            }
            own = {**fields, **self.host.own_fields(client)}
            client.frame = f"{text},{json.dumps(own, separators=(',', ':'))[1:]}"
            client.frame_number, client.edition = self._frames, self.host.edition
            client.frame_ready.set()

    def _status(self) -> dict[str, Any]:
        """Return the data about players and server for all pages."""
        drivers, recorder = self.match.drivers, self.host.recorder
        film = [recorder.trouble] if recorder is not None else []
        return {
            "seats": [
                {
                    "driver": p["driver"],
                    "level": drivers.level(i),
                    "taken": p["person"] is not None,
                }
                for i, p in enumerate(self._seats.players)
            ],
            "troubles": [*drivers.troubles, *film],
            "watching": sum(client.seat is None for client in self.clients),
            "rate": round(self.rate, 1),
            "recording": recorder is not None and recorder.runs,
            "not_recorded": recorder.failure if recorder is not None else "",
        }
