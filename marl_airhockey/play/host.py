"""Host of a session: what pages may do at a match, and what they get to know."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from marl_airhockey.play.client import Client
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.seats import Seats

GONE = "a player has gone"
"""Reason of a match that is paused as a page has gone"""
GRACE = 10.0
"""Time for which the seat of a page that has gone, say to reload, is reserved, s."""
Handler = Callable[..., None]
"""Function of a page and the fields of its message"""


class Host(ABC):
    """Host of a session.

    Args:
        seats: Seats of the match.
    """

    def __init__(self, seats: Seats) -> None:
        self.seats, self.match = seats, seats.match

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
        """Return what a page gets once: the match, and what can be chosen; JSON."""

    def status(self) -> dict[str, Any]:
        """Return what all pages get at every tick in addition; JSON."""
        return {}

    def own_fields(self, client: Client) -> dict[str, Any]:
        """Return what one page alone gets at every tick in addition; JSON."""
        return {}

    def clear_table(self, reason: str) -> None:
        """End the match and its recording, so that others find a fresh lobby."""
        if self.recorder is not None:
            self.recorder.end(self.match, reason)
        self.match.clear()

    def before_message(self) -> None:
        """Do what is due before a message is handled."""
        return None

    def disconnected(self, client: Client) -> None:
        """Free the seat of a page that has gone."""
        if client.seat is not None:
            self.seats.leave(client, GONE)

    def after_tick(self) -> None:
        """Do what follows a tick of the match."""
        return None

    @abstractmethod
    def check_presence(self, now: float) -> None:
        """Handle pages that are idle or gone; called once a second.

        Args:
            now: Monotonic time, s.
        """
