"""Loop of a match: it ticks in real time, is recorded and sent to all pages."""

from __future__ import annotations

import asyncio
import json
import time
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.handicap import PRESETS
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.recorder import Recorder

BEHIND = 6
"""Ticks that the loop makes up for when it is late; more are skipped."""
ASIDE = 0.1
"""Time after which pages get a frame even if a real table is not yet ready, s."""


class MatchLoop:
    """Match that runs in real time and is sent to the connected pages.

    Args:
        match: what is played.
        recorder: where episodes are written; None for nowhere.
    """

    def __init__(self, match: LiveMatch, recorder: Recorder | None = None) -> None:
        self.match, self.recorder = match, recorder
        self.clients: set[Client] = set()
        self.rate = float(RATE)
        """Ticks a second, over the last second."""
        self._recorded: list[dict[str, Any]] = []
        """Value of `players` when the recording of this episode began."""
        self.failure: BaseException | None = None
        """Exception that ended the loop, if one did."""

    @property
    def players(self) -> list[dict[str, Any]]:
        """Driver, person's pseudonym and consent of each seat; None for programs."""
        people = {c.seat: (c.name, c.consent) for c in self.clients}
        rows = []
        for i, driver in enumerate(self.match.drivers.names):
            person, consent = people.get(i, (None, None))
            rows.append(
                {"seat": i, "driver": driver, "person": person, "consent": consent}
            )
        return rows

    async def run(self) -> None:
        """Tick for ever, in real time."""
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
                self._check_presence(time.monotonic())
            if now - due > BEHIND / RATE:
                due = now
            await asyncio.sleep(max(due - now, 0.0))

    def tick(self) -> None:
        """Advance the match by a tick, record it and send it to all pages."""
        self._share(self.match.tick())

    async def _tick_aside(self, match: RealMatch) -> None:
        """Advance a match on a real table, in a thread, as that takes its time."""
        match.watched = bool(self.clients)
        self._check_hands(time.monotonic())
        ticking = asyncio.ensure_future(asyncio.to_thread(match.tick))
        while not (await asyncio.wait({ticking}, timeout=ASIDE))[0]:
            self._broadcast()
        self._share(ticking.result())

    def _share(self, moved: bool) -> None:
        """Record a tick and send it to all pages."""
        if self.recorder is not None:
            self._record(self.recorder, moved)
        if self.clients:
            self._broadcast()

    def _record(self, recorder: Recorder, moved: bool) -> None:
        """Write the tick; a match whose players change is not played to the end."""
        match = self.match
        if moved and match.ticks == 1:
            self._recorded = self.players
            recorder.begin(match, self._recorded)
        if moved and self.players != self._recorded:
            recorder.end(match, "the players changed")
        elif moved:
            delays: list[float | None] = [None] * len(match.seats)
            for client in self.clients:
                if client.seat is not None:
                    delays[client.seat] = client.round_trip
            recorder.step(match, delays)
        if match.phase == "done":
            recorder.end(match, match.reason or "played to the end")

    def _broadcast(self) -> None:
        """Give every page a new frame; one that was not sent in time is dropped."""
        shared = {"t": "state", **self.match.state(), **self._status()}
        text = json.dumps(shared, separators=(",", ":"))[:-1]
        for client in self.clients:
            own = json.dumps(self._own_fields(client), separators=(",", ":"))
            client.frame = f"{text},{own[1:]}"
            client.frame_ready.set()

    def describe(self) -> dict[str, Any]:
        """Return what a page gets once: the match, and what can be chosen; JSON."""
        return {
            **self.match.describe(),
            "choices": self.match.drivers.choices,
            "handicaps": list(PRESETS),
        }

    def _status(self) -> dict[str, Any]:
        """Return what all pages get about players, the handicap and the server."""
        handicap = self.match.drivers.handicap
        presets = {preset: name for name, preset in PRESETS.items()}
        return {
            "seats": [
                {"driver": p["driver"], "taken": p["person"] is not None}
                for p in self.players
            ],
            "handicap": presets.get(handicap, handicap.caption),
            "troubles": [*self.match.drivers.troubles, *self._film_troubles()],
            "watching": sum(client.seat is None for client in self.clients),
            "rate": round(self.rate, 1),
            "recording": self.recorder is not None
            and self.match.phase in ("countdown", "play", "pause"),
        }

    def _film_troubles(self) -> list[str]:
        """Return what is missing in the video that is being written."""
        return [self.recorder.trouble] if self.recorder is not None else []

    def _own_fields(self, client: Client) -> dict[str, Any]:
        """Return what one page alone gets."""
        return {"seat": client.seat, "ack": client.acknowledged}

    def _check_presence(self, now: float) -> None:
        """Handle pages that are idle or gone; called once a second."""

    def _check_hands(self, now: float) -> None:
        """Let the arm rest that nobody holds; called at every tick of a real table."""
