"""Move behind the puck and push it up the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


@dataclass
class Template(Driver):
    """Driver that moves behind the puck and pushes it."""

    # The fields are options: `airhockey evaluate my_driver.py:behind=0.1 ...`.
    behind: float = 0.08
    """Distance between the paddle and the puck before the push, m."""
    gain: float = 6.0
    """Commanded speed per distance to the target, 1/s."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        # Arrays have one row per world. All quantities are in the ego frame of the
        # seat: its own end is at the smallest x. `view.observation` is the input of a
        # policy, and `view.state` has the same quantities by name.
        if not view.scene.pucks:
            return np.zeros((len(view.observation), 2)), memory
        own, puck = view.state.paddle[:, view.seat], view.state.puck[:, 0]
        up = np.array([1.0, 0.0])
        place, beyond = puck - self.behind * up, puck + 0.1 * up
        ready = length(place - own) < 0.04
        target = np.where(ready[:, None], beyond, place)
        # An action is the target velocity divided by the top speed. Store values for
        # later steps in the memory, as arrays with one row per world, not in `self`.
        # `def reset(self, seat, rng, worlds)` returns the memory at the start.
        return (target - own) * self.gain / view.top_speed[:, None], memory


make = Template
