"""Table of a tournament: the players of the current pair sit, all others watch."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Mapping
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.game_menu import GameMenu
from marl_airhockey.play.host import Handler
from marl_airhockey.play.open_table import OpenTable
from marl_airhockey.play.plant import Plant
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.tournament import Pairing, Tournament

PATIENCE = 30.0
"""Time for which a pair waits for an absent player, s."""
TIE, RESULT = 4.0, 20.0
"""Times for which a tie and a result are shown, s. The pair can end the latter."""


class TournamentTable(OpenTable):
    """Host of a knock-out tournament in a game for two people.

    Args:
        seats: Seats of the match, both for people.
        recorder: Recorder of the matches; None to record nothing.

    Raises:
        ValueError: The match has not two seats of two teams.
    """

    def __init__(self, seats: Seats, recorder: Recorder | None) -> None:
        match = seats.match
        if len(match.seats) != 2 or match.seats[0].team == match.seats[1].team:
            name = match.world.scenario.name
            raise ValueError(f"a tournament needs a game of two players, not {name}")
        super().__init__(seats, recorder, Plant(), GameMenu())
        self.tournament = Tournament()
        self._waits_since = time.monotonic()
        """Time since which the current pair is not complete, s."""
        self._pair: Pairing | None = None
        """Pair at the table, until the next one is called."""
        self._decided = False
        """True from the end of a match until the next pair is called."""
        self._over_since = 0.0
        """Time of the end of the last match, s."""
        own = ("aim", "stick", "pause", "insight")
        self._own: dict[str, Handler] = {
            **{name: self._handlers[name] for name in own},
            "hello": self._hello,
            "name": self._name,
            "begin": self._begin,
            "start": self._start,
        }

    @property
    def handlers(self) -> Mapping[str, Handler]:
        return self._own

    def describe(self) -> dict[str, Any]:
        return {**super().describe(), "tournament": True}

    def status(self) -> dict[str, Any]:
        state = {**super().status(), "tournament": self.tournament.state()}
        pair, names = self._pair, self.tournament.names
        if pair is not None:
            taken = {client.seat for client in self.seats.clients}
            state["seats"] = [
                {
                    "driver": "person",
                    "level": "",
                    "taken": i in taken,
                    "title": names[key],
                }
                for i, key in enumerate(pair.players)
            ]
        return state

    def own_fields(self, client: Client) -> dict[str, Any]:
        name = self.tournament.names.get(client.key, "")
        return {"queue": 0, "idle": None, "name": name}

    def disconnected(self, client: Client) -> None:
        if client.seat is not None:
            self.seats.leave(client, "a player has disconnected")
        elif client.key:
            self.tournament.withdraw(client.key)

    def check_presence(self, now: float) -> None:
        """Seat the current pair; a player who is absent too long loses the match."""
        self._seat_pair()
        if self._decided and now - self._over_since > RESULT:
            self._next_pair()
        pair = self.tournament.current
        if pair is None or not self.seats.free or self._decided:
            self._waits_since = now
        elif now - self._waits_since > PATIENCE and len(self.seats.free) == 1:
            self.tournament.finish(1 - self.seats.free[0])
            self._next_pair()

    def after_tick(self) -> None:
        super().after_tick()
        match, now = self.match, time.monotonic()
        if match.phase != "done" or match.reason:
            self._over_since = now
            return
        if self._decided:
            return
        if not match.winners:
            if now - self._over_since > TIE:
                match.start_golden_goal()
            return
        goals = match.tally.state()["scores"] or (0, 0)
        self.tournament.finish(match.winners[0], tuple(goals))
        self._decided = True

    def _hello(self, client: Client, key: str) -> None:
        client.key, client.name = key, hashlib.sha256(key.encode()).hexdigest()[:8]
        self._seat_pair()

    def _name(self, client: Client, text: str) -> None:
        if client.key:
            with contextlib.suppress(ValueError):
                self.tournament.enter(client.key, text)

    def _begin(self, client: Client) -> None:
        if client.key in self.tournament.names:
            self.tournament.begin()
            self._next_pair()

    def _start(self, client: Client) -> None:
        """Start the match of the pair; after its result, call the next pair."""
        if self._decided and client.seat is not None:
            self._next_pair()
        elif client.seat is not None and not self.seats.free:
            self.match.start()

    def _next_pair(self) -> None:
        self._pair, self._decided = self.tournament.current, False
        self.clear_table("the next pair plays")
        for client in self.seats.clients:
            client.seat = None
        self._waits_since = time.monotonic()
        self._seat_pair()

    def _seat_pair(self) -> None:
        """Give the seats to the pages of the current pair that are connected."""
        pair = self._pair
        if pair is None or self._decided:
            return
        for seat in self.seats.free:
            for client in self.seats.clients:
                if client.key == pair.players[seat] and client.seat is None:
                    self.seats.take(client, seat)
                    break
