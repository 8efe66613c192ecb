"""Driver of a person with a gamepad, whose stick commands a velocity."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length

DEAD = 0.12
"""Dead zone of the stick, as a share of full tilt."""


class Gamepad(Driver):
    """Driver of a person with a gamepad. Full tilt of the stick is the top speed."""

    needs_person = True

    def __init__(self) -> None:
        self.stick = (0.0, 0.0)

    def push(self, x: float, y: float) -> None:
        """Set the tilt of the stick, share of full tilt, ego frame."""
        self.stick = (x, y)

    def rest(self) -> None:
        """Release the stick."""
        self.stick = (0.0, 0.0)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        tilt = float(length(np.array(self.stick)))
        # The speed increases from 0 at the edge of the dead zone.
        live = max(min(tilt, 1.0) - DEAD, 0.0) / (1.0 - DEAD) / max(tilt, 1e-9)
        action = live * np.array(self.stick)
        return np.broadcast_to(action, (len(view.rng), 2)).copy(), memory


make = Gamepad
