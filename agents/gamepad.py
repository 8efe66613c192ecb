"""A person's gamepad: the stick is a velocity."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View

DEAD = 0.12
"""Share of the stick's way that is taken for rest."""


class Gamepad(Driver):
    """Asks for the velocity that the stick shows, ego frame; full tilt is top speed."""

    def __init__(self) -> None:
        self.stick = (0.0, 0.0)

    def push(self, x: float, y: float) -> None:
        """Tilt the stick: shares of full tilt, ego frame."""
        self.stick = (x, y)

    def rest(self) -> None:
        """Let go of the stick."""
        self.stick = (0.0, 0.0)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        tilt = np.hypot(*self.stick)
        # From the edge of the dead zone on, the speed grows from nothing.
        live = max(min(tilt, 1.0) - DEAD, 0.0) / (1.0 - DEAD) / max(tilt, 1e-9)
        action = live * np.array(self.stick)
        return np.broadcast_to(action, (len(view.rng), 2)).copy(), memory


make = Gamepad
