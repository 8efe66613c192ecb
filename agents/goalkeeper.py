"""Stand between the puck and one's own end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, View, tactics


@dataclass
class Goalkeeper(tactics.Scripted):
    """Goes where the nearest puck will cross a line near the own end, banks too."""

    depth: float = 0.03
    """m: distance of the line from the near edge of the reach."""
    gain: float = 8.0
    """1/s: asked speed for a metre of distance."""

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
