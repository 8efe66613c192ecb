"""Manual steps of a calibration, done automatically in the virtual lab."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from marl_airhockey.hardware.lab.lab import LabClient
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

GUIDED = 4.0
"""Longest time until the arm has reached the next position, s."""
PUCK = (0.3, 0.0)
"""Position of the puck during the calibration, table frame, m."""


class HandHelper:
    """Helper for the calibration of a hand in a running lab.

    Args:
        client: Client of the lab.
    """

    def __init__(self, client: LabClient) -> None:
        self._client, self._boards = client, 0
        self.source = f"stream:{client.ask('hand', middle=[0.0, 0.0])['camera']}"
        """Source of the frames of the hand's camera."""
        self.orders: dict[str, Callable[..., None]] = {
            "show_board": self.show_board,
            "board_away": self.put_board_away,
        }
        """Functions of the commands, by name."""

    def show_board(self) -> None:
        """Show the board to the camera in the next pose."""
        self._client.ask("hand_board", number=self._boards)
        self._boards += 1
        time.sleep(0.3)

    def put_board_away(self) -> None:
        """Put the board away."""
        self._client.ask("hand_board", number=None)
        time.sleep(0.3)


class Helper:
    """Helper for the calibration of a table in a running lab.

    Args:
        client: Client of the lab.
    """

    def __init__(self, client: LabClient) -> None:
        self._client, self._boards, self._guided = client, 0, 0
        table = TABLES[client.ask("info")["table"]]
        reach = np.array(make_seat("robot", table, 0).reach)
        middle = reach.mean(0)
        inner = middle + 0.9 * (reach - middle)
        self._positions = np.concatenate(
            [[middle], inner, middle + 0.5 * (inner - middle)]
        )
        client.ask("place", puck=list(PUCK), velocity=[0.0, 0.0])
        self.orders: dict[str, Callable[..., None]] = {
            "show_board": self.show_board,
            "guide": self.guide,
        }
        """Functions of the commands, by name."""

    def show_board(self) -> None:
        """Show the board to the camera in the next pose."""
        self._client.ask("board", number=self._boards)
        self._boards += 1
        time.sleep(0.3)

    def guide(self) -> None:
        """Put the board away and move the paddle to its next position."""
        self._client.ask("board", number=None)
        target = self._positions[self._guided % len(self._positions)]
        self._guided += 1
        self._client.ask("guide", place=target.tolist())
        until = time.monotonic() + GUIDED
        while time.monotonic() < until:
            truth = np.array(self._client.ask("truth")["paddle"])
            if np.linalg.norm(truth[:2] - target) < 1e-3:
                break
            time.sleep(0.05)
        time.sleep(0.4)
