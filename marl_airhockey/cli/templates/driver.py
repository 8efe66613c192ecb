"""Goes to the puck and pushes it up the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


@dataclass
class Template(Driver):
    """Driver that gets behind the puck and pushes it."""

    # The fields are options: `airhockey evaluate my_driver.py:behind=0.1 ...`.
    behind: float = 0.08
    """Distance at which it gets behind the puck before it pushes (m)."""
    gain: float = 6.0
    """Commanded speed per distance (1/s)."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        # All worlds at once: arrays have one row a world. Everything is in the frame of
        # the seat, whose paddle is at the low end of x, whatever end it plays.
        # `view.observation` is what a policy sees; `view.state` has names.
        if not view.scene.pucks:
            return np.zeros((len(view.observation), 2)), memory
        own, puck = view.state.paddle[:, view.seat], view.state.puck[:, 0]
        up = np.array([1.0, 0.0])
        place, beyond = puck - self.behind * up, puck + 0.1 * up
        ready = length(place - own) < 0.04
        target = np.where(ready[:, None], beyond, place)
        # An action is the wanted velocity as a fraction of the top speed. What is to be
        # remembered goes into the memory, arrays with one row a world, never on `self`.
        return (target - own) * self.gain / view.top_speed[:, None], memory


make = Template
