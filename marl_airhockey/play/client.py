"""Connected page of a session."""

from __future__ import annotations

import asyncio
import secrets
import time
from typing import Any

from marl_airhockey.play.link import Link
from marl_airhockey.play.protocol import RateLimiter


class Client:
    """State of a connected page."""

    def __init__(self) -> None:
        self.name = secrets.token_hex(4)
        """Pseudonym of the page, which is the same in all of its games."""
        self.key = ""
        """Secret that identifies a page after it is loaded again."""
        self.consent: str | None = None
        """Version of the texts to which the person agreed in a study."""
        self.seat: int | None = None
        self.watches = False
        """True for a page that may only watch."""
        self.acknowledged = 0
        """Number of the last aim that was used in a control step."""
        self.round_trip: float | None = None
        """Time from an aim to the frame that shows it, ms, as measured by the page."""
        self.last_input = time.monotonic()
        """Time of the last movement, s."""
        self.last_held = float("-inf")
        """Time of the last aim with a pointer that is held down, s."""
        self.pointer = (float("nan"), float("nan"))
        """Last aim, table frame, m."""
        self.device: dict[str, Any] = {}
        """Fields of the message ``device``, see `protocol.MESSAGES`."""
        self.wants_insight = False
        """True if the page shows what a driver observes."""
        self.limiter = RateLimiter(self.last_input)
        self.frame = ""
        """Newest message to send; it replaces a message that was not sent in time."""
        self.events: list[list[Any]] = []
        """Events since the last frame that was sent, see `LiveMatch.events`."""
        self.edition = -1
        """Edition of the host to which the newest message belongs."""
        self.frame_number = 0
        """Number of the newest message."""
        self.frame_ready = asyncio.Event()
        self.link = Link(self.last_input)
