"""One connected page, as a session knows it."""

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
        """Pseudonym: the same for all games of a page, known to nobody."""
        self.key = ""
        """Secret by which a page is recognised when it is loaded again."""
        self.consent: str | None = None
        """Version of the texts that the person has agreed to, in a study."""
        self.seat: int | None = None
        self.watches = False
        """True for a page that may watch and nothing else."""
        self.acknowledged = 0
        """Number of the last aim that a control step has used."""
        self.round_trip: float | None = None
        """Time from an aim to the frame that shows it, ms, as measured by the page."""
        self.last_input = time.monotonic()
        """Time of the last movement, s."""
        self.last_held = float("-inf")
        """Time of the last aim by a pointer that is held, s."""
        self.pointer = (float("nan"), float("nan"))
        """Last aim, table frame, m."""
        self.device: dict[str, Any] = {}
        """Fields of the message ``device``, see `protocol.MESSAGES`."""
        self.limiter = RateLimiter(self.last_input)
        self.frame = ""
        """Newest message to be sent; it replaces one that was not sent in time."""
        self.frame_number = 0
        """Number of that frame."""
        self.frame_ready = asyncio.Event()
        self.link = Link(self.last_input)
