"""Operator who puts the puck at its start position and allows the arm to move."""

from __future__ import annotations

import json
import socket
import sys
import time
from collections.abc import Callable
from typing import Protocol

from marl_airhockey.types import Array

ANSWER = 5.0
"""Longest time until a lab answers, s."""
LOOK = 5.5
"""Time for which the lab's operator inspects a stopped arm, s."""


class Operator(Protocol):
    """Operator of a table."""

    def begin(self, motion: str) -> None:
        """Wait until the arm may move for the first time.

        Args:
            motion: Text for a person: where the arm may move and how fast.
        """

    def place(self, puck: Array, velocity: Array, block: Array | None) -> None:
        """Put the puck at its start position and hold it there.

        Args:
            puck: Start position (2,), table frame, m.
            velocity: Velocity (2,) at the release, table frame, m/s.
            block: Start position (2,) of the block, m; None without one.

        Raises:
            RuntimeError: The operator does not place the puck.
        """

    def release(self) -> None:
        """Release the puck, with the requested velocity as far as possible."""

    def allow(self, stop: str) -> None:
        """Wait until a stopped arm has been inspected and may continue.

        Args:
            stop: Reason of the stop, as a text for a person.
        """


Ask = Callable[[str], None]
"""Function that shows a text to a person and returns when the person agrees."""


class LabOperator:
    """Operator of a virtual lab, which carries out requests exactly.

    Args:
        port: Port of the lab's RPC server, on the loopback address.
        ask: Function that requests permission for a stopped arm to continue.
    """

    def __init__(self, port: int, ask: Ask) -> None:
        self._address, self._ask_person = ("127.0.0.1", port), ask

    def _ask(self, **order: object) -> None:
        try:
            with socket.create_connection(self._address, ANSWER) as door:
                door.sendall(json.dumps(order).encode() + b"\n")
                line = door.makefile().readline()
        except OSError as error:
            raise RuntimeError(f"lab: no answer: {error}") from error
        answer = json.loads(line) if line else {"error": "it has ended"}
        if "error" in answer:
            raise RuntimeError(f"lab: {answer['error']}")

    def begin(self, motion: str) -> None:
        """Return immediately: there are no people in the virtual lab."""

    def place(self, puck: Array, velocity: Array, block: Array | None) -> None:
        more = {} if block is None else {"block": block.tolist()}
        self._ask(do="place", puck=puck.tolist(), velocity=velocity.tolist(), **more)

    def release(self) -> None:
        self._ask(do="release")

    def allow(self, stop: str) -> None:
        self._ask_person(_stopped(stop))


class PersonOperator:
    """Operator who is a person.

    Args:
        ask: Function that requests a confirmation of the person.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask

    def begin(self, motion: str) -> None:
        self._ask(
            f"{motion} Is this space free of people, and do you hold the enabling "
            "device?"
        )

    def place(self, puck: Array, velocity: Array, block: Array | None) -> None:
        aside = "" if block is None else f"Put the block at {_where(block)}. "
        self._ask(
            f"{aside}Put the puck at {_where(puck)} (from the table's centre; x points "
            "away from the robot, y to its left), hold it there, and take the enabling "
            "device."
        )

    def release(self) -> None:
        self._ask("Confirm, and release the puck at the same time.")

    def allow(self, stop: str) -> None:
        self._ask(_stopped(stop))


def _where(position: Array) -> str:
    return f"x = {position[0]:+.2f} m, y = {position[1]:+.2f} m"


def _stopped(why: str) -> str:
    return (
        f"The arm has stopped: {why}. Inspect it, clear its path, and release an "
        "emergency stop at the pendant. May it continue?"
    )


def ask_at_terminal(words: str) -> None:
    """Request a confirmation of a person at the terminal.

    Raises:
        RuntimeError: The standard input is not a terminal.
    """
    if not sys.stdin.isatty():
        raise RuntimeError(
            "operator: the standard input is not a terminal; run the command in one, "
            f"where a person confirms: {words}"
        )
    print(f"{words} Press Enter to continue, Ctrl+C to end.")
    input()


def look(words: str) -> None:
    """Confirm after `LOOK` seconds, as the virtual lab's operator."""
    # A stopped arm cannot continue earlier.
    time.sleep(LOOK)


def make_operator(text: str, ask: Ask | None = None) -> Operator:
    """Return the operator of a rig.

    Args:
        text: Name of the operator, ``person`` or ``lab:PORT``.
        ask: Function that requests a confirmation of a person; None for the terminal,
            or for `look` in a lab.

    Raises:
        ValueError: There is no such operator.
    """
    kind, _, port = text.partition(":")
    if kind == "person" and not port:
        return PersonOperator(ask or ask_at_terminal)
    if kind == "lab" and port.isdigit():
        return LabOperator(int(port), ask or look)
    raise ValueError(f"operator {text!r}: expected person or lab:PORT")
