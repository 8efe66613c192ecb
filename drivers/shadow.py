"""Driver that follows a paddle in a person's hand, under a camera of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np

from marl_airhockey.hardware.hand import Hand, HandMotion
from marl_airhockey.hardware.hand_rig import HandRig
from marl_airhockey.toolkit import (
    Array,
    Driver,
    PrescribedMotion,
    RandomStreams,
    Seat,
    View,
    length,
)
from marl_airhockey.toolkit.pointing import ARM_LAG, point_to

CATCH = 0.08
"""Largest distance between hand and paddle at which the paddle starts to follow a hand
that has entered the image, m."""


class Shadow(Driver):
    """Driver that follows a paddle which a person moves under a camera of its own.

    The field of view of this camera is mapped to the seat's workspace. The driver
    commands velocities toward the position of the hand, within the limits of the seat.
    It starts when the hand has come to the position of the paddle. If the hand leaves
    the image, the paddle stops.

    With ``prescribe`` the driver is position-driven: the paddle has the position of the
    hand. This needs a simulated seat.

    Args:
        rig: File of the hand's camera, which ``airhockey calibrate --hand`` writes.
        prescribe: True for a position-driven paddle.
        lag: Lag of the arm, s, see `point_to`.

    Raises:
        ValueError: There is no such rig, or it cannot be read.
    """

    needs_person = True
    needs_device = True

    def __init__(self, rig: str, prescribe: bool = False, lag: float = ARM_LAG) -> None:
        self._rig = HandRig.load(Path(rig))
        self._prescribe, self._lag = prescribe, lag
        self._hand: Hand | None = None
        self._low, self._high = np.zeros(2), np.zeros(2)
        self._place = np.full(2, np.nan)
        self._caught = False

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_hand": None}

    def __enter__(self) -> Self:
        self._open()
        return self

    def _open(self) -> Hand:
        """Return the camera of the hand; a copy of the driver opens it again."""
        if self._hand is None:
            self._hand = Hand(self._rig).__enter__()
        return self._hand

    @property
    def trouble(self) -> str:
        hand = self._open()
        if hand.trouble or self._prescribe or self._caught:
            return hand.trouble
        return "move the hand's paddle to the position of the arm's paddle"

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        reach = np.asarray(seat.reach)
        self._low, self._high = reach.min(0), reach.max(0)
        self._place, self._caught = reach.mean(0), False
        return {}

    def _target(self, motion: HandMotion) -> tuple[Array, Array]:
        """Return position, m, and velocity, m/s, of the hand in the workspace."""
        stretch = (self._high - self._low) / np.array(self._rig.size)
        middle = (self._high + self._low) / 2
        place = np.clip(middle + stretch * motion.place, self._low, self._high)
        return place, stretch * motion.velocity

    def measured(self) -> PrescribedMotion | None:
        """Return position and velocity of the hand (1, 4); None without `prescribe`."""
        if not self._prescribe:
            return None
        motion = self._open().read()
        velocity = np.zeros(2)
        if motion is not None:
            self._place, velocity = self._target(motion)
        return np.concatenate([self._place, velocity])[None]

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own = view.state.paddle[:, view.seat]
        motion = self._open().read()
        if motion is None:
            self._caught = False
            return np.zeros_like(own), memory
        place, velocity = self._target(motion)
        self._caught |= bool((length(place - own) < CATCH).all())
        if not self._caught:
            return np.zeros_like(own), memory
        return point_to(view, place, velocity, self._lag), memory

    def __exit__(self, *_: object) -> None:
        if self._hand is not None:
            self._hand.__exit__(None, None, None)
            self._hand = None


make = Shadow
