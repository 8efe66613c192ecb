"""What pages may say to the server: a line of JSON, checked field by field."""

from __future__ import annotations

import json
import math
from typing import Any

LARGEST = 1024
"""Characters of a message."""
FASTEST = 240.0
"""Messages per second that a page may send on average."""
BURST = 480.0
"""Messages that it may send at once."""
MESSAGES: dict[str, dict[str, type]] = {
    "hello": {"key": str},
    "aim": {"x": float, "y": float, "q": int, "rtt": float},
    "stick": {"x": float, "y": float, "q": int, "rtt": float},
    "start": {},
    "pause": {},
    "stop": {},
    "swap": {},
    "sit": {"seat": int},
    "leave": {},
    "opponent": {"seat": int, "name": str},
    "strength": {"name": str},
    "consent": {"version": str},
    "answer": {"question": str, "value": int},
    "withdraw": {},
    "next": {},
}
"""Kinds of messages and their fields. Places are metres in the table frame, sticks
shares of full tilt in the table frame, ``q`` counts a page's aims, ``rtt`` is the time
in ms that it measured between an aim and the frame that shows it. The last four are of
studies alone."""


def parse(text: str) -> tuple[str, dict[str, Any]]:
    """The kind of a message and its fields.

    Raises:
        ValueError: anything but one of `MESSAGES`; says what is wrong.
    """
    if len(text) > LARGEST:
        raise ValueError(f"a message has at most {LARGEST} characters")
    try:
        data = json.loads(text, parse_constant=_refuse)
    except RecursionError as error:
        raise ValueError("not JSON: too deep") from error
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
    raise ValueError(f"{name} is no number")


def _check(name: str, value: Any, kind: type) -> Any:
    if kind is str:
        if not isinstance(value, str) or not 0 < len(value) <= 80:
            raise ValueError(f"{name}: must be 1 to 80 characters")
        return value
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or abs(value) > 1e9 or not math.isfinite(value):
        raise ValueError(f"{name}: must be a number")
    if kind is int and (value != int(value) or value < 0):
        raise ValueError(f"{name}: must be a whole number, not negative")
    return kind(value)


class Meter:
    """How often somebody may speak: a bucket that fills at `FASTEST`."""

    def __init__(self, now: float) -> None:
        self._level, self._last = BURST, now

    def take(self, now: float) -> None:
        """Count a message.

        Raises:
            ValueError: too many.
        """
        self._level = min(BURST, self._level + (now - self._last) * FASTEST) - 1.0
        self._last = now
        if self._level < 0.0:
            raise ValueError(f"more than {FASTEST:.0f} messages a second")
