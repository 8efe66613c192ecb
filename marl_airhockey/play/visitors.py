"""Visitors of a table: who waits for a seat, and for whom a seat is reserved."""

from __future__ import annotations

from marl_airhockey.play.client import Client
from marl_airhockey.play.seats import Seats


class Visitors:
    """Queue of pages without a seat, and reserved seats.

    Args:
        seats: Seats of the match.
    """

    def __init__(self, seats: Seats) -> None:
        self._seats = seats
        self._reserved: dict[int, tuple[str, float]] = {}
        """Key of the last page of a free seat, and the time until which the seat is
        reserved for it, s, by seat."""
        self._waiting: list[Client] = []

    def wait(self, client: Client) -> None:
        """Add a page to the end of the queue."""
        if client.seat is None and client not in self._waiting:
            self._waiting.append(client)

    def leave_queue(self, client: Client) -> None:
        """Remove a page from the queue."""
        if client in self._waiting:
            self._waiting.remove(client)

    def position(self, client: Client) -> int:
        """Return the position of a page in the queue, from 1; 0 outside the queue."""
        waiting = self._waiting
        return waiting.index(client) + 1 if client in waiting else 0

    def reserve(self, seat: int, client: Client, until: float) -> None:
        """Reserve a free seat for the page that has left it, until a time, s."""
        self._reserved[seat] = client.key, until

    def returns(self, seat: int, client: Client) -> bool:
        """Return True if a page was the last one of a free seat."""
        return bool(client.key) and self._reserved.get(seat, ("", 0.0))[0] == client.key

    def forget(self, seat: int | None = None) -> None:
        """Cancel the reservation of a seat; None for all seats."""
        if seat is None:
            self._reserved.clear()
        else:
            self._reserved.pop(seat, None)

    def any_reserved(self, now: float) -> bool:
        """Return True if a seat is reserved at a time, s."""
        return any(until > now for _, until in self._reserved.values())

    def next(self, now: float) -> tuple[Client, int] | None:
        """Return the next page of the queue that can have a seat, and the seat.

        Pages that return to their seat come first.

        Args:
            now: Monotonic time, s.
        """
        free = self._seats.free
        for client in self._waiting:
            for seat in free:
                if self.returns(seat, client):
                    return client, seat
        nobody = "", 0.0
        open_ones = [s for s in free if self._reserved.get(s, nobody)[1] <= now]
        if self._waiting and open_ones:
            return self._waiting[0], open_ones[0]
        return None
