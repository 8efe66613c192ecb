"""Driver of a person with a mouse, whose paddle moves to the pointer."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View
from marl_airhockey.toolkit.pointing import point_to


class Mouse(Driver):
    """Driver of a person with a mouse, whose paddle moves to the pointer.

    Args:
        lag: Lag of the paddle, s, see `point_to`.
    """

    needs_person = True

    def __init__(self, lag: float = 0.0) -> None:
        self._lag = lag
        self.target: tuple[float, float] | None = None
        """Target position, ego frame, m; None for no target."""

    def aim(self, x: float, y: float) -> None:
        """Set the target position, ego frame, m."""
        self.target = (x, y)

    def rest(self) -> None:
        """Clear the target position; the paddle stops."""
        self.target = None

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        if self.target is None:
            return np.zeros((len(view.top_speed), 2)), memory
        return point_to(view, np.array(self.target), lag=self._lag), memory


make = Mouse
