"""Host of a session, which defines what pages may do and what they receive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from marl_airhockey.play.client import Client
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats

GONE = "a player has disconnected"
"""Reason for the pause of a match after a page disconnected."""
GRACE = 10.0
"""Time for which the seat of a page that disconnected is reserved, s."""
Handler = Callable[..., None]
"""Function of a page and the fields of its message."""


class Images(Protocol):
    """Images of a match, which are made next to the loop of ticks."""

    @property
    def failure(self) -> str:
        """Reason why there are no more images; "" if there are."""

    def offer(self, match: LiveMatch) -> None:
        """Take the state of a match for the next image."""

    def newest(self, after: int) -> tuple[int, bytes] | None:
        """Return number and JPEG of the next image; None if there is none in time."""


class Host(ABC):
    """Host of a session.

    Args:
        seats: Seats of the match.
    """

    def __init__(self, seats: Seats) -> None:
        self.seats = seats
        self.edition = 0
        """Number of changes of the JSON that `describe` returns."""
        self.scene: Images | None = None
        """Images of the 3D scene; None without simulated arms."""
        self.invitation: dict[str, Any] | None = None
        """Link and code by which other people open the page; None without a network."""

    @property
    def match(self) -> LiveMatch:
        """Match of the session now."""
        return self.seats.match

    @property
    @abstractmethod
    def handlers(self) -> Mapping[str, Handler]:
        """Handlers of the messages that pages may send, by kind."""

    @property
    @abstractmethod
    def recorder(self) -> Recorder | None:
        """Recorder of the episodes; None for none."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return the JSON that a page receives once for each value of `edition`."""

    def status(self) -> dict[str, Any]:
        """Return the additional JSON that all pages receive at every tick."""
        return {}

    def own_fields(self, client: Client) -> dict[str, Any]:
        """Return the additional JSON that one page receives at every tick."""
        return {}

    def clear_table(self, reason: str) -> None:
        """End the match and its recording, and return to the lobby."""
        if self.recorder is not None:
            self.recorder.end(self.match, reason)
        self.match.clear()

    def before_message(self) -> None:
        """Update the host before a message is handled."""
        return None

    def disconnected(self, client: Client) -> None:
        """Free the seat of a page that disconnected."""
        if client.seat is not None:
            self.seats.leave(client, GONE)

    def after_tick(self) -> None:
        """Update the host after a tick of the match."""
        return None

    def close(self) -> None:
        """Close the match when the server stops."""
        self.match.close()

    @abstractmethod
    def check_presence(self, now: float) -> None:
        """Handle pages that are idle or disconnected; called once per second.

        Args:
            now: Monotonic time, s.
        """
