"""Process of the lab's hand, which follows requested paths in front of its camera."""

from __future__ import annotations

import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from marl_airhockey.hardware.camera.camera import CameraFrame
from marl_airhockey.hardware.lab.frame_server import FrameServer
from marl_airhockey.hardware.lab.hand_camera import HandCamera, SeenHand, hand_view
from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.types import Array


@dataclass(frozen=True)
class HandPath:
    """Path of a hand: an ellipse with a constant period."""

    middle: Array
    """Centre (2,), field frame, m."""
    amplitude: Array
    """Half axes (2,), m; 0 for a hand at rest."""
    period: float = 1.0
    """Time of one turn, s."""
    began: float = 0.0
    """Time at which the path begins, monotonic clock, s."""
    away: bool = False
    """True if no hand is in the image."""

    def at(self, now: float) -> tuple[Array, Array]:
        """Return position (2,), m, and velocity (2,), m/s, at a time, s."""
        rate = 2 * np.pi / self.period
        angle = rate * (now - self.began)
        offset = np.array([np.cos(angle), np.sin(angle)])
        change = rate * np.array([-np.sin(angle), np.cos(angle)])
        return self.middle + self.amplitude * offset, self.amplitude * change


def run_hand(setup: LabSetup, frame_rate: float, seed: int, pipe: Connection) -> None:
    """Send frames of the hand until the other end of the pipe is closed."""
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
            position, velocity = path.at(due)
            seen = SeenHand(None if path.away else position, velocity)
            server.send(CameraFrame(camera.photograph(seen, number), due, number))


def path_of(order: dict[str, Any]) -> HandPath:
    """Return the path of a request.

    Args:
        order: Request "hand" with the fields of `HandPath`.

    Raises:
        ValueError: A number is not finite, or the period is not above 0.
    """
    middle, amplitude = (
        np.asarray(order.get(name, (0.0, 0.0)), float)
        for name in ("middle", "amplitude")
    )
    period = float(order.get("period", 1.0))
    fits = middle.shape == amplitude.shape == (2,) and period > 0.0
    if not fits or not np.isfinite([*middle, *amplitude, period]).all():
        raise ValueError(
            "hand: expected middle and amplitude as two numbers, m, period above 0, s"
        )
    began, away = time.monotonic(), bool(order.get("away", False))
    return HandPath(middle, amplitude, period, began, away)


def _answer(path: HandPath) -> dict[str, Any]:
    now = time.monotonic()
    position, velocity = path.at(now)
    return {
        "time": now,
        "place": position.tolist(),
        "velocity": velocity.tolist(),
        "away": path.away,
    }
