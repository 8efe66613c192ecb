"""Open table: a match in which every page can take a free seat."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Mapping
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.demonstration import Demonstration
from marl_airhockey.play.game_menu import GameMenu
from marl_airhockey.play.host import GONE, GRACE, Handler, Host
from marl_airhockey.play.insight import checkpoints, observed
from marl_airhockey.play.ladder import usual_level
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.plant import Plant
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.session import Session
from marl_airhockey.play.visitors import Visitors

GOAL_STOP = 3.6
"""Time for which play stops after a goal, s: pages show the goal for 0.6 s, then the
last 1.5 s at half speed."""


def open_table(
    match: LiveMatch,
    recorder: Recorder | None = None,
    plant: Plant | None = None,
    menu: GameMenu | None = None,
) -> Session:
    """Return a session in which every page can take a free seat.

    Args:
        match: Match of the session.
        recorder: Recorder of the episodes; None to record nothing.
        plant: Devices of a virtual lab, whose faults pages may switch.
        menu: Games among which players choose; None for the match only.
    """
    table = OpenTable(Seats(match), recorder, plant or Plant(), menu or GameMenu())
    return Session(table)


class OpenTable(Host):
    """Host that assigns a free seat to every page.

    Args:
        seats: Seats of the match.
        recorder: Recorder of the episodes; None to record nothing.
        plant: Devices whose faults pages may switch.
        menu: Games among which players choose.
    """

    def __init__(
        self, seats: Seats, recorder: Recorder | None, plant: Plant, menu: GameMenu
    ) -> None:
        super().__init__(seats)
        self._recorder, self.plant, self.menu = recorder, plant, menu
        self._demonstration = Demonstration()
        self.visitors = Visitors(seats)
        self._handlers: dict[str, Handler] = {
            "hello": self._hello,
            "aim": seats.aim,
            "stick": seats.stick,
            "start": self._start,
            "pause": self._pause,
            "stop": self._stop,
            "substitute": self._substitute,
            "golden_goal": self._golden_goal,
            "swap": self._swap,
            "sit": self._sit,
            "leave": self._leave,
            "opponent": self._opponent,
            "join": self._join,
            "game": self._game,
            "insight": self._insight,
            "checkpoint": self._checkpoint,
            "lobby": self._lobby,
            "fault": self._fault,
        }

    @property
    def handlers(self) -> Mapping[str, Handler]:
        return self._handlers

    @property
    def recorder(self) -> Recorder | None:
        return self._recorder

    def describe(self) -> dict[str, Any]:
        ladder = self.match.drivers.ladder
        return {
            **self.match.describe(),
            "games": self.menu.rows,
            "ladder": [level.name for level in ladder],
            "usual": usual_level(ladder).name,
            "policy": self.match.drivers.best_policy,
            "checkpoints": checkpoints(self.match),
            "invite": self.invitation,
            "scene": self.scene is not None,
            "camera": isinstance(self.match, RealMatch),
            "faults": dict(self.plant.faults),
        }

    def status(self) -> dict[str, Any]:
        state: dict[str, Any] = {"opening": self.menu.opening}
        if self.match.phase == "lobby":
            state["demo"] = self._demonstration.state()
        if any(client.wants_insight for client in self.seats.clients):
            state["insight"] = observed(self.match)
        if self.scene is not None:
            state["scene"] = self.scene.failure
        if self.plant.faults:
            state["faults"] = list(self.plant.active())
        return state

    def after_tick(self) -> None:
        """Play a demonstration in the lobby; open a chosen game that is prepared."""
        if self.scene is not None:
            self.scene.offer(self.match)
        prepared = self.menu.take()
        if prepared is not None:
            self._open(prepared)
        is_lobby = self.match.phase == "lobby" and self.seats.clients
        if is_lobby and not isinstance(self.match, RealMatch):
            self._demonstration.tick(self.match)

    def _open(self, match: LiveMatch) -> None:
        """Replace the match by that of another game; players keep their seats."""
        self.clear_table("another game was chosen")
        self.match.close()
        self._demonstration.end()
        match.goal_stop = self.match.goal_stop
        self.seats.match = match
        self.visitors.forget()
        self.edition += 1
        people = [i for i, name in enumerate(match.drivers.names) if name == PERSON]
        for client in self.seats.clients:
            if client.seat is not None and client.seat not in people:
                client.seat = None
                self.visitors.wait(client)
        self._seat_waiting(time.monotonic())

    def close(self) -> None:
        self.menu.close()
        self._demonstration.end()
        super().close()

    def own_fields(self, client: Client) -> dict[str, Any]:
        idle = self.seats.idle_warning(client, time.monotonic())
        return {"queue": self.visitors.position(client), "idle": idle}

    def disconnected(self, client: Client) -> None:
        """Free the seat of a page that disconnected, and reserve it for `GRACE`."""
        self.visitors.leave_queue(client)
        if client.seat is not None:
            self._free(client, GONE, time.monotonic() + GRACE)

    def check_presence(self, now: float) -> None:
        """Free the seats of idle pages, seat those that wait, clear an empty table."""
        for client in self.seats.clients:
            if self.seats.is_idle(client, now):
                self._free(client, "a player has been idle", now)
        self._seat_waiting(now)
        people = self.match.drivers.names.count(PERSON)
        reserved = self.visitors.any_reserved(now)
        if people and len(self.seats.free) == people and not reserved:
            self.visitors.forget()
            if self.match.phase != "lobby":
                self.clear_table("everybody has left")

    def _free(self, client: Client, reason: str, until: float) -> None:
        """Free the seat of a page, which can return to it until a time, s."""
        assert client.seat is not None
        self.visitors.reserve(client.seat, client, until)
        self.seats.leave(client, reason)

    def _take(self, client: Client, seat: int) -> None:
        """Assign a seat to a page; a new person does not continue a running match."""
        returns = self.visitors.returns(seat, client)
        self.visitors.forget(seat)
        self.visitors.leave_queue(client)
        if not returns and self.match.phase != "lobby":
            self.clear_table("the players changed")
        self.seats.take(client, seat)
        if self.match.reason == GONE and not self.seats.free:
            self.match.start()

    def _seat_waiting(self, now: float) -> None:
        """Give free seats to the pages that wait, at a time, s."""
        while found := self.visitors.next(now):
            self._take(*found)

    def _hello(self, client: Client, key: str) -> None:
        client.key, client.name = key, hashlib.sha256(key.encode()).hexdigest()[:8]
        self._join(client)

    def _join(self, client: Client) -> None:
        """Give a page a seat, or let it wait for one."""
        self.visitors.wait(client)
        self._seat_waiting(time.monotonic())

    def _start(self, client: Client) -> None:
        if self.seats.may_control(client) and not self.seats.free:
            self.match.start()

    def _pause(self, client: Client) -> None:
        if self.seats.may_control(client):
            self.match.pause()

    def _stop(self, client: Client) -> None:
        if self.seats.may_control(client):
            self.match.abort("ended by a player")

    def _substitute(self, client: Client) -> None:
        """Set drivers for the seats that people have left, and continue the match."""
        if client.seat is None or self.match.phase != "pause":
            return
        level = usual_level(self.match.drivers.ladder)
        for seat in self.seats.free:
            self.match.replace_driver(seat, level.driver, level.handicap)
        self.visitors.forget()
        self.match.start()

    def _insight(self, client: Client, on: int) -> None:
        """Start or stop to send what a driver observes to a page."""
        client.wants_insight = bool(on)

    def _checkpoint(self, client: Client, seat: int, name: str) -> None:
        """Replace a driver by another stage of its training, even in a match."""
        drivers = self.match.drivers
        stages = [row["name"] for row in checkpoints(self.match)]
        is_policy = seat < len(drivers.names) and drivers.names[seat] != PERSON
        if self.seats.may_control(client) and name in stages and is_policy:
            self.match.replace_driver(seat, name, drivers.handicaps[seat])

    def _game(self, client: Client, name: str) -> None:
        """Choose another game of the menu, between matches."""
        if self.seats.may_control(client) and self._between_matches:
            self.menu.choose(name)

    def _lobby(self, client: Client) -> None:
        """Return from a result to the start screen."""
        if self.seats.may_control(client) and self.match.phase == "done":
            self.match.clear()

    def _golden_goal(self, client: Client) -> None:
        if self.seats.may_control(client) and not self.seats.free:
            self.match.start_golden_goal()

    @property
    def _between_matches(self) -> bool:
        return self.match.phase in ("lobby", "done")

    def _swap(self, client: Client) -> None:
        """Move all players to the next seat; in a duel they change ends."""
        if not self.seats.may_control(client) or not self._between_matches:
            return
        drivers = self.match.drivers
        names, handicaps = list(drivers.names), list(drivers.handicaps)
        for i, (name, handicap) in enumerate(zip(names, handicaps, strict=True)):
            self.match.set_driver((i + 1) % len(names), name, handicap)
        for other in self.seats.clients:
            if other.seat is not None:
                other.seat = (other.seat + 1) % len(names)
        self.visitors.forget()

    def _sit(self, client: Client, seat: int) -> None:
        if seat in self.seats.free:
            if client.seat is not None:
                self._free(client, "a player has changed seats", 0.0)
            self._take(client, seat)

    def _leave(self, client: Client) -> None:
        if client.seat is not None:
            self._free(client, "a player has left", 0.0)

    def _opponent(self, client: Client, seat: int, name: str) -> None:
        """Set a person or a level of the ladder as the driver of a seat."""
        drivers, taken = self.match.drivers, [c.seat for c in self.seats.clients]
        if not self.seats.may_control(client) or not self._between_matches:
            return
        if seat >= len(drivers.names) or seat in taken:
            return
        if name == PERSON:
            self.match.set_driver(seat, PERSON)
        for level in drivers.ladder:
            if level.name == name:
                # Levels fit; a match on a real table rejects limited observations.
                with contextlib.suppress(ValueError):
                    self.match.set_driver(seat, level.driver, level.handicap)

    def _fault(self, client: Client, name: str, on: int) -> None:
        if self.seats.may_control(client) and name in self.plant.faults:
            self.plant.switch(name, bool(on))
