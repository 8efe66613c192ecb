"""Mouse of a person: the paddle moves to the pointer."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


class Mouse(Driver):
    """Driver that commands a velocity which ends at rest at a wanted position.

    The command is bounded by the seat's top speed and by a speed from which the paddle
    can still stop in time; `limits` bounds it further, as for every driver.
    """

    gain = 25.0
    """Commanded speed per distance near the target (1/s)."""
    brake = 0.6
    """Share of the seat's acceleration that is assumed for stopping in time."""

    def __init__(self) -> None:
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
        own = view.state.paddle[:, view.seat]
        if self.target is None:
            return np.zeros_like(own), memory
        way = np.array(self.target) - own
        far = np.maximum(length(way), 1e-9)
        brake = self.brake * view.scene.seats[view.seat].acceleration
        speed = np.minimum(self.gain * far, np.sqrt(2.0 * brake * far))
        speed = np.minimum(speed, view.top_speed)
        return way * (speed / far / view.top_speed)[:, None], memory


make = Mouse
