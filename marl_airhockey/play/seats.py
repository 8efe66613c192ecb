"""Seats of a match, the pages that have them, and the input of the pages."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from marl_airhockey.play.client import Client
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.match_drivers import PERSON
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.sim.core.recording import Columns

IDLE = 60.0
"""Time without a movement after which a person is idle, s."""
WARNING = 15.0
"""Time before the loss of a seat in which an idle page shows a warning, s."""
LET_GO = 0.3
"""Time without a message of a pointer that is held down after which an arm rests, s."""


class Seats:
    """Pages of a match and their seats.

    Args:
        match: Match whose paddles the pages move.
    """

    def __init__(self, match: LiveMatch) -> None:
        self.match = match
        self.clients: set[Client] = set()
        """Connected pages, with or without a seat."""

    @property
    def free(self) -> list[int]:
        """Indices of the seats for people that no page has taken."""
        taken = {client.seat for client in self.clients}
        names = enumerate(self.match.drivers.names)
        return [i for i, name in names if name == PERSON and i not in taken]

    @property
    def players(self) -> list[dict[str, Any]]:
        """Driver and its handicap, and pseudonym and consent of the person, by seat.

        Pseudonym and consent are None for other drivers.
        """
        people = {c.seat: (c.name, c.consent) for c in self.clients}
        drivers, rows = self.match.drivers, []
        for i, driver in enumerate(drivers.names):
            person, consent = people.get(i, (None, None))
            row = {"seat": i, "driver": driver, "handicap": vars(drivers.handicaps[i])}
            rows.append({**row, "person": person, "consent": consent})
        return rows

    @property
    def devices(self) -> list[dict[str, Any] | None]:
        """Devices that the page of each seat reports; None for seats without a page."""
        found = {c.seat: c.device for c in self.clients}
        return [found.get(i) for i in range(len(self.match.seats))]

    @property
    def columns(self) -> Columns:
        """Columns of a recording with the input of pages, by seat; nan if unknown.

        ``round_trip`` is (seats,), ms. ``pointer`` is the last aim (seats, 2), table
        frame, m.
        """
        seats = len(self.match.seats)
        trips, pointers = np.full(seats, np.nan), np.full((seats, 2), np.nan)
        for client in self.clients:
            if client.seat is not None:
                trips[client.seat] = client.round_trip or np.nan
                pointers[client.seat] = client.pointer
        return {"round_trip": trips, "pointer": pointers}

    def may_control(self, client: Client) -> bool:
        """Return True for pages with a seat, and for all pages if no people play."""
        return client.seat is not None or PERSON not in self.match.drivers.names

    def take(self, client: Client, seat: int) -> None:
        """Assign a seat to a page."""
        client.seat, client.last_input = seat, time.monotonic()

    def leave(self, client: Client, reason: str) -> None:
        """Free the seat of a page and pause the match."""
        assert client.seat is not None
        mouse: Any = self.match.drivers.input_device(client.seat, "mouse")
        mouse.rest()
        client.seat = None
        self.match.pause(reason)

    def idle_warning(self, client: Client, now: float) -> int | None:
        """Return the time until a page is idle, s, if it is short; else None."""
        left = IDLE - (now - client.last_input)
        is_near = client.seat is not None and left < WARNING
        return max(0, round(left)) if is_near else None

    def is_idle(self, client: Client, now: float) -> bool:
        """Return True for a page with a seat and no movement for `IDLE`."""
        return client.seat is not None and now - client.last_input > IDLE

    def aim(
        self, client: Client, x: float, y: float, held: int, q: int, rtt: float
    ) -> None:
        """Set the target of a page's paddle; handler of a message.

        Args:
            client: Page that sent the message.
            x: Target position along x, table frame, m.
            y: Target position along y, table frame, m.
            held: 1 while the pointer is held down.
            q: Number of the message.
            rtt: Last round trip, ms; 0 if unknown.
        """
        if client.seat is None:
            return
        mouse: Any = self.match.drivers.input_device(client.seat, "mouse")
        if held:
            client.last_held = time.monotonic()
        if held or not isinstance(self.match, RealMatch):
            mouse.aim(*self._to_ego(client.seat, x, y))
        else:
            mouse.rest()
        if (x, y) != client.pointer:
            client.pointer, client.last_input = (x, y), time.monotonic()
        client.acknowledged, client.round_trip = q, rtt if rtt > 0.0 else None

    def stick(self, client: Client, x: float, y: float, q: int, rtt: float) -> None:
        """Set the tilt of a page's stick, fractions of full tilt; handler of a message.

        The components are along the axes of the table frame.
        """
        if client.seat is None:
            return
        gamepad: Any = self.match.drivers.input_device(client.seat, "gamepad")
        gamepad.push(*self._to_ego(client.seat, x, y))
        client.last_held = time.monotonic()
        if (x, y) != (0.0, 0.0):
            client.last_input = time.monotonic()
        client.acknowledged, client.round_trip = q, rtt if rtt > 0.0 else None

    def _to_ego(self, i: int, x: float, y: float) -> tuple[float, float]:
        """Rotate a vector from the table frame into the ego frame of a seat."""
        rotation = self.match.world.scene.table.rotation(self.match.seats[i].side)
        rotated = rotation @ np.array([x, y])
        return float(rotated[0]), float(rotated[1])

    def rest_unheld(self, now: float) -> None:
        """Stop paddles whose pointer is released, or whose page is silent."""
        drivers = self.match.drivers
        for client in self.clients:
            if client.seat is not None and now - client.last_held > LET_GO:
                kind = drivers.kind_of_device(client.seat)
                device: Any = drivers.input_device(client.seat, kind)
                device.rest()
