"""Process of the lab's hand: it moves as it is told, before a camera of its own."""

from __future__ import annotations

import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from marl_airhockey.devices.camera.camera import Frame
from marl_airhockey.lab.frame_server import FrameServer
from marl_airhockey.lab.hand_camera import HandCamera, SeenHand, hand_view
from marl_airhockey.lab.setup import LabSetup
from marl_airhockey.types import Array


@dataclass(frozen=True)
class HandPath:
    """Path of a hand: an ellipse about a middle, at a steady rhythm."""

    middle: Array
    """(2,) field's frame, m"""
    amplitude: Array
    """(2,) half axes, m; 0 to hold still"""
    period: float = 1.0
    """Time of a round, s"""
    began: float = 0.0
    """Time at which it begins, of the monotonic clock, s"""
    away: bool = False
    """True for a hand that has left"""

    def at(self, now: float) -> tuple[Array, Array]:
        """Return place (2,), m, and velocity (2,), m/s."""
        rate = 2 * np.pi / self.period
        angle = rate * (now - self.began)
        round_ = np.array([np.cos(angle), np.sin(angle)])
        ahead = rate * np.array([-np.sin(angle), np.cos(angle)])
        return self.middle + self.amplitude * round_, self.amplitude * ahead


def run_hand(setup: LabSetup, frame_rate: float, seed: int, pipe: Connection) -> None:
    """Film the hand until the other end of the pipe is closed."""
    server, camera = FrameServer(setup.latency), HandCamera(hand_view(), seed=seed)
    path = HandPath(np.zeros(2), np.zeros(2))
    pipe.send({"port": server.port})
    due, number = time.monotonic(), 0
    while True:
        try:
            while pipe.poll():
                order = pipe.recv()
                if order["do"] == "hand":
                    path = path_of(order)
                elif order["do"] == "hand_board":
                    camera.show_board(order["number"])
                pipe.send(_answer(path))
        except (EOFError, OSError):
            return
        due, number = max(due + 1.0 / frame_rate, time.monotonic() - 0.1), number + 1
        time.sleep(max(due - time.monotonic(), 0.0))
        if server.watched:
            place, velocity = path.at(due)
            seen = SeenHand(None if path.away else place, velocity)
            server.send(Frame(camera.photograph(seen, number), due, number))


def path_of(order: dict[str, Any]) -> HandPath:
    """Return the path that an order asks for.

    Raises:
        ValueError: numbers that make no sense.
    """
    middle, amplitude = (
        np.asarray(order.get(name, (0.0, 0.0)), float)
        for name in ("middle", "amplitude")
    )
    period = float(order.get("period", 1.0))
    fits = middle.shape == amplitude.shape == (2,) and period > 0.0
    if not fits or not np.isfinite([*middle, *amplitude, period]).all():
        raise ValueError("hand: middle and amplitude are two numbers, m; period is s")
    began, away = time.monotonic(), bool(order.get("away", False))
    return HandPath(middle, amplitude, period, began, away)


def _answer(path: HandPath) -> dict[str, Any]:
    now = time.monotonic()
    place, velocity = path.at(now)
    return {
        "time": now,
        "place": place.tolist(),
        "velocity": velocity.tolist(),
        "away": path.away,
    }
