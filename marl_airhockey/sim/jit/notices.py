"""Notices on standard error during a compilation: its name and its duration."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

PAUSE = 2.0
"""Time after a compilation from which the next one with its name is announced again,
s."""
EVERY = 10.0
"""Time between two notices, s."""
FIRST, LATER = 50, 4
"""Usual time to compile a scenario with an empty cache, and after another one, s."""


@dataclass
class _Notice:
    """Times of a compilation or of waiting for one, monotonic clock, s."""

    began: float
    said: float
    ended: float = float("inf")


_compilations: dict[str, _Notice] = {}
"""Last compilation with each name. It can consist of several compilations in a row."""


@contextmanager
def announced_compilation(name: str, first: bool, why: str = "") -> Iterator[None]:
    """Announce a compilation, and every ten seconds that it continues.

    Args:
        name: Subject of the notices.
        first: True if nothing was compiled on this machine yet.
        why: Reason why the code that comes with the package is not used; "" if the
            package contains none.
    """
    notice, now = _compilations.get(name), time.monotonic()
    if notice is None or now - notice.ended > PAUSE:
        notice = _compilations[name] = _Notice(now, now)
        about = FIRST if first else LATER
        reason = f"; the code that comes with the package {why}" if why else ""
        _print(f"compiling {name} once, about {about} s{reason}")
    with _repeated(f"still compiling {name}", notice):
        yield
    notice.ended = time.monotonic()


@contextmanager
def announced_wait(name: str) -> Iterator[None]:
    """Report every ten seconds that another process compiles the required code."""
    now = time.monotonic()
    with _repeated(f"another process compiles {name}", _Notice(now, now)):
        yield


@contextmanager
def repeated(say: Callable[[], None], first: float | None = None) -> Iterator[None]:
    """Call a function every ten seconds, in a thread, until the block ends.

    Args:
        say: Function to call.
        first: Time until the first call, s; None for ten seconds.
    """
    over = threading.Event()

    def repeat() -> None:
        wait = EVERY if first is None else first
        while not over.wait(wait):
            say()
            wait = EVERY

    threading.Thread(target=repeat, daemon=True).start()
    try:
        yield
    finally:
        over.set()


@contextmanager
def _repeated(text: str, notice: _Notice) -> Iterator[None]:
    """Print a text every ten seconds, with the time so far."""

    def say() -> None:
        notice.said = time.monotonic()
        _print(f"{text}, {notice.said - notice.began:.0f} s so far")

    with repeated(say, max(notice.said + EVERY - time.monotonic(), 0.0)):
        yield


def _print(text: str) -> None:
    print(f"marl_airhockey: {text}", file=sys.stderr, flush=True)
