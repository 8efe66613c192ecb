"""Messages from a page to the server: JSON objects whose fields are checked."""

from __future__ import annotations

import json
import math
from typing import Any

LARGEST = 1024
"""Largest number of characters in a message."""
RATE_LIMIT = 240.0
"""Largest average number of messages per second of a page."""
BURST = 480.0
"""Largest number of messages in a burst."""
LONGEST = 800
"""Largest number of characters in a text."""


class Text(str):
    """Text with at most `LONGEST` characters, which may be empty."""

    __slots__ = ()


MESSAGES: dict[str, dict[str, type]] = {
    "hello": {"key": str},
    "seen": {"f": int},
    "device": {
        "input": str,
        "width": int,
        "height": int,
        "density": float,
        "hz": float,
    },
    "aim": {"x": float, "y": float, "held": int, "q": int, "rtt": float},
    "stick": {"x": float, "y": float, "q": int, "rtt": float},
    "start": {},
    "pause": {},
    "stop": {},
    "substitute": {},
    "golden_goal": {},
    "swap": {},
    "sit": {"seat": int},
    "leave": {},
    "opponent": {"seat": int, "name": str},
    "join": {},
    "game": {"name": str},
    "lobby": {},
    "name": {"text": str},
    "begin": {},
    "insight": {"on": int},
    "checkpoint": {"seat": int, "name": str},
    "fault": {"name": str, "on": int},
    "consent": {"version": str},
    "answer": {"question": str, "value": int},
    "comment": {"question": str, "text": Text},
    "withdraw": {},
    "next": {},
}
"""Kinds of messages (key ``t``) and the types of their fields.

In ``aim``, ``x`` and ``y`` are a position, table frame, m. In ``stick`` they are
fractions of full tilt along the axes of the table frame. ``held`` is 1 while a button
or a finger is down; a real arm only moves then. ``q`` counts the aims of a page.
``rtt`` is the time from an aim to the frame that shows it, as measured by the page, ms.
``device`` contains the input device, the size of the window, the number of screen
pixels per pixel of the window, and the frame rate of the page, frames/s. ``seen``
acknowledges a frame and all previous ones by its number. The last five kinds belong to
studies.
"""


def parse(text: str) -> tuple[str, dict[str, Any]]:
    """Return the kind of a message and its fields.

    Raises:
        ValueError: The text is not one of `MESSAGES`.
    """
    if len(text) > LARGEST:
        raise ValueError(f"a message can have at most {LARGEST} characters")
    try:
        data = json.loads(text, parse_constant=_refuse)
    except RecursionError as error:
        raise ValueError("not JSON: it is nested too deeply") from error
    except json.JSONDecodeError as error:
        raise ValueError("not JSON") from error
    if not isinstance(data, dict) or data.get("t") not in list(MESSAGES):
        raise ValueError(f"t: must be one of {', '.join(MESSAGES)}")
    kind = data.pop("t")
    wanted = MESSAGES[kind]
    if data.keys() != wanted.keys():
        raise ValueError(f"{kind}: fields must be {sorted(wanted)}")
    return kind, {name: _check(name, data[name], wanted[name]) for name in wanted}


def _refuse(name: str) -> None:
    """Raise ValueError for NaN and Infinity, which are not part of JSON."""
    raise ValueError(f"{name} is not a number")


def _check(name: str, value: Any, kind: type) -> Any:
    """Return the value of a field as its type; raise ValueError for another type."""
    if kind is Text:
        if not isinstance(value, str) or len(value) > LONGEST:
            raise ValueError(f"{name}: must be at most {LONGEST} characters")
        return value
    if kind is str:
        if not isinstance(value, str) or not 0 < len(value) <= 80:
            raise ValueError(f"{name}: must be 1 to 80 characters")
        return value
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or abs(value) > 1e9 or not math.isfinite(value):
        raise ValueError(f"{name}: must be a number")
    if kind is int and (value != int(value) or value < 0):
        raise ValueError(f"{name}: must be a whole number of at least 0")
    return kind(value)


class RateLimiter:
    """Token bucket that refills at `RATE_LIMIT` up to `BURST`.

    Args:
        now: Current time, s.
    """

    def __init__(self, now: float) -> None:
        self._level, self._last = BURST, now

    def acquire(self, now: float) -> None:
        """Count a message that arrives at a time, s.

        Raises:
            ValueError: The page has sent too many messages.
        """
        refilled = self._level + (now - self._last) * RATE_LIMIT
        self._level = min(BURST, refilled) - 1.0
        self._last = now
        if self._level < 0.0:
            raise ValueError(f"more than {RATE_LIMIT:.0f} messages per second")
