"""Stand between the puck and one's own end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.driver import Driver, View
from marl_airhockey.state import Array


@dataclass
class Goalkeeper(Driver):
    """Follows the nearest approaching puck sideways on a line near the own end."""

    depth: float = 0.08
    """m: distance of the line from the near edge of the reach."""
    gain: float = 8.0
    """1/s: asked speed for a metre of distance."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own = view.state.paddle[:, view.seat]
        line = view.reach[:, 0].min() + self.depth
        if view.state.bodies.pucks == 0:
            return np.stack([line - own[:, 0], -own[:, 1]], -1) * self.gain, memory
        puck, velocity = view.state.puck, view.state.puck_velocity
        rows = np.arange(len(own))
        urgent = np.where(velocity[..., 0] < 0, puck[..., 0], 9.0).argmin(-1)
        place, speed = puck[rows, urgent], velocity[rows, urgent]
        due = np.clip((place[:, 0] - line) / np.maximum(-speed[:, 0], 0.3), 0.0, 0.3)
        wide = np.abs(view.reach[:, 1]).max()
        aside = np.clip(place[:, 1] + due * speed[:, 1], -wide, wide)
        target = np.stack([np.full_like(aside, line), aside], -1)
        return (target - own) * self.gain / view.top_speed[:, None], memory


make = Goalkeeper
