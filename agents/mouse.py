"""A person's pointer: the paddle goes where it points."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


class Mouse(Driver):
    """Holds a wanted position and asks for a velocity that ends there at rest.

    What it asks is bounded by the seat's top speed and by a speed from which the paddle
    can still stop in time; `limits` bounds it once more, as it does for everybody.
    """

    gain = 25.0
    """1/s: asked speed for a metre of distance, near the target."""
    brake = 0.6
    """Share of the seat's acceleration that is reckoned with for stopping in time."""

    def __init__(self) -> None:
        self.target: tuple[float, float] | None = None
        """Ego frame, m; None while nobody points."""

    def aim(self, x: float, y: float) -> None:
        """Point at a place, ego frame, m."""
        self.target = (x, y)

    def rest(self) -> None:
        """Point nowhere: stand still."""
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
