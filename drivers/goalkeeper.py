"""Driver that stays between the puck and its own end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, View, tactics


@dataclass
class Goalkeeper(tactics.Scripted):
    """Driver that moves to the predicted crossing of its line by the nearest puck.

    The prediction includes wall bounces.
    """

    depth: float = 0.03
    """Distance of the line from the near edge of the workspace, m."""
    gain: float = 8.0
    """Commanded speed per distance to the target, 1/s."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own = view.state.paddle[:, view.seat]
        if view.state.bodies.pucks == 0:
            line = view.reach[:, 0].min() + self.depth
            return np.stack([line - own[:, 0], -own[:, 1]], -1) * self.gain, memory
        field = tactics.Field.of(view.scene, view.seat)
        target = tactics.guard(view, field, self.depth, self._skill.lag)
        return self._paced((target - own) * self.gain, view), memory


make = Goalkeeper
