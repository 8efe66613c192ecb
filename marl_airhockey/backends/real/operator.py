"""Operator: who puts the puck on the table where an episode is to begin."""

from __future__ import annotations

import json
import socket
import sys
import time
from collections.abc import Callable
from typing import Protocol

from marl_airhockey.types import Array

ANSWER = 5.0
"""Longest time until a lab answers, s"""
LOOK = 5.5
"""Time for which an operator looks at an arm that has stopped, s"""


class Operator(Protocol):
    """Operator of a table."""

    def begin(self, motion: str) -> None:
        """Return when the arm may move for the first time.

        Args:
            motion: where it may move and how fast, in words.
        """

    def place(self, puck: Array, velocity: Array) -> None:
        """Put the puck at (2,), m, and hold it there.

        Raises:
            RuntimeError: it is not done.
        """

    def release(self) -> None:
        """Let the puck go, with the velocity it was to have as far as that can be."""

    def allow(self, stop: str) -> None:
        """Return when somebody has looked at an arm that stopped and lets it go on.

        Args:
            stop: why it stopped, in words.
        """


Ask = Callable[[str], None]
"""Function that shows words to a person and returns when they agree"""


class LabOperator:
    """Operator of a virtual lab, who does exactly what is asked for.

    Args:
        port: of the lab's door, on the loopback address.
        ask: who is asked whether a stopped arm may go on.
    """

    def __init__(self, port: int, ask: Ask) -> None:
        self._address, self._ask_person = ("127.0.0.1", port), ask

    def _ask(self, **order: object) -> None:
        try:
            with socket.create_connection(self._address, ANSWER) as door:
                door.sendall(json.dumps(order).encode() + b"\n")
                answer = json.loads(door.makefile().readline() or "{}")
        except OSError as error:
            raise RuntimeError(f"lab: it does not answer: {error}") from error
        if "error" in answer:
            raise RuntimeError(f"lab: {answer['error']}")

    def begin(self, motion: str) -> None:
        """Return at once: in the virtual lab nobody is in the way."""

    def place(self, puck: Array, velocity: Array) -> None:
        self._ask(do="place", puck=puck.tolist(), velocity=velocity.tolist())

    def release(self) -> None:
        self._ask(do="release")

    def allow(self, stop: str) -> None:
        self._ask_person(_stopped(stop))


class PersonOperator:
    """Operator who is a person.

    Args:
        ask: how they are asked.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask

    def begin(self, motion: str) -> None:
        self._ask(f"{motion} Is nobody within that, and the enabling device in a hand?")

    def place(self, puck: Array, velocity: Array) -> None:
        self._ask(
            f"Put the puck at x = {puck[0]:+.2f} m, y = {puck[1]:+.2f} m (from the "
            "table's centre, away from the robot and to its left), hold it there, and "
            "take the enabling device."
        )

    def release(self) -> None:
        self._ask("Let the puck go with your word.")

    def allow(self, stop: str) -> None:
        self._ask(_stopped(stop))


def _stopped(why: str) -> str:
    return (
        f"The arm has stopped: {why}. Look at it, clear what is in its way, and "
        "release an emergency stop at the pendant. May it go on?"
    )


def ask_at_terminal(words: str) -> None:
    """Ask a person at the terminal.

    Raises:
        RuntimeError: nobody is there.
    """
    if not sys.stdin.isatty():
        raise RuntimeError(
            f"operator: nobody is at a terminal who could be asked: {words}"
        )
    print(f"{words} Enter to go on, Ctrl+C to end.")
    input()


def look(words: str) -> None:
    """Agree, as the virtual lab's own person: who has looked at the arm for a while."""
    # An arm refuses to go on earlier.
    time.sleep(LOOK)


def make_operator(text: str, ask: Ask | None = None) -> Operator:
    """Return the operator that a rig names.

    Args:
        text: ``person`` or ``lab:PORT``.
        ask: who is asked; None for the terminal, or the lab's own person.

    Raises:
        ValueError: an unknown one.
    """
    kind, _, port = text.partition(":")
    if kind == "person" and not port:
        return PersonOperator(ask or ask_at_terminal)
    if kind == "lab" and port.isdigit():
        return LabOperator(int(port), ask or look)
    raise ValueError(f"operator {text!r}: expected person or lab:PORT")
