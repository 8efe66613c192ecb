"""Mouse of a person: the paddle moves to the pointer."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View
from marl_airhockey.toolkit.pointing import point_to


class Mouse(Driver):
    """Driver that commands a velocity which ends at rest at a wanted position.

    Args:
        lag: time by which the paddle answers late, see `point_to`, s.
    """

    needs_person = True

    def __init__(self, lag: float = 0.0) -> None:
        self._lag = lag
        self.target: tuple[float, float] | None = None
        """Wanted position, ego frame, m; None without one."""

    def aim(self, x: float, y: float) -> None:
        """Set the wanted position, ego frame, m."""
        self.target = (x, y)

    def rest(self) -> None:
        """Clear the wanted position: stand still."""
        self.target = None

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        if self.target is None:
            return np.zeros((len(view.top_speed), 2)), memory
        return point_to(view, np.array(self.target), lag=self._lag), memory


make = Mouse
