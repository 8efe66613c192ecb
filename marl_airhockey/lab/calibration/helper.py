"""Helper: the virtual lab's own person, who does what a calibration asks for."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.table import TABLES
from marl_airhockey.lab.lab import LabClient

GUIDED = 4.0
"""Longest time in which the arm is at the next place, s"""
PUCK = (0.3, 0.0)
"""Place at which the puck lies meanwhile, m"""


class HandHelper:
    """Helper in a running lab who is the hand.

    Args:
        client: of the lab.
    """

    def __init__(self, client: LabClient) -> None:
        self._client, self._boards = client, 0
        self.source = f"stream:{client.ask('hand', middle=[0.0, 0.0])['camera']}"
        """Source of the pictures of the hand's camera"""
        self.orders: dict[str, Callable[..., None]] = {
            "show_board": self.show_board,
            "board_away": self.put_board_away,
        }
        """What can be asked for, by name"""

    def show_board(self) -> None:
        """Hold the board before the camera in another way."""
        self._client.ask("hand_board", number=self._boards)
        self._boards += 1
        time.sleep(0.3)

    def put_board_away(self) -> None:
        """Put the board away."""
        self._client.ask("hand_board", number=None)
        time.sleep(0.3)


class Helper:
    """Helper in a running lab.

    Args:
        client: of the lab.
    """

    def __init__(self, client: LabClient) -> None:
        self._client, self._boards, self._guided = client, 0, 0
        table = TABLES[client.ask("info")["table"]]
        reach = np.array(make_seat("robot", table, 0).reach)
        middle = reach.mean(0)
        inner = middle + 0.9 * (reach - middle)
        self._places = np.concatenate(
            [[middle], inner, middle + 0.5 * (inner - middle)]
        )
        client.ask("place", puck=list(PUCK), velocity=[0.0, 0.0])
        self.orders: dict[str, Callable[..., None]] = {
            "show_board": self.show_board,
            "guide": self.guide,
        }
        """What can be asked for, by name"""

    def show_board(self) -> None:
        """Hold the board before the camera in another way."""
        self._client.ask("board", number=self._boards)
        self._boards += 1
        time.sleep(0.3)

    def guide(self) -> None:
        """Put the board away and let the paddle stand at the next place."""
        self._client.ask("board", number=None)
        place = self._places[self._guided % len(self._places)]
        self._guided += 1
        self._client.ask("guide", place=place.tolist())
        until = time.monotonic() + GUIDED
        while time.monotonic() < until:
            truth = np.array(self._client.ask("truth")["paddle"])
            if np.linalg.norm(truth[:2] - place) < 1e-3:
                break
            time.sleep(0.05)
        time.sleep(0.4)
