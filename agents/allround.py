"""Guard the own goal and strike at the open one: an opponent for games."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, View, tactics


@dataclass
class Allround(tactics.Scripted):
    """Strikes a puck that it can get behind in time; else it guards."""

    depth: float = 0.02
    """m: where it guards, from the near edge of the reach."""
    ready: float = 0.07
    """m: where it waits, from its own end."""
    gain: float = 16.0
    """1/s: asked speed for a metre of distance."""
    patience: float = 0.3
    """s: a puck that can be met no sooner is waited for."""
    brave: float = 1.6
    """m/s: a puck that comes faster is met by guarding."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own, (pace, lag) = view.state.paddle[:, view.seat], self._skill
        if not view.state.bodies.pucks:
            return np.zeros_like(own), memory
        field = tactics.Field.of(view.scene, view.seat)
        aim = tactics.open_goal(view, field)
        strike, due = tactics.attack(view, field, aim, pace, lag)
        place, motion = tactics.nearest_puck(view, lag)
        fast = motion[:, 0] < -self.brave
        can = due < self.patience
        guard = tactics.guard(view, field, self.depth, lag)
        ready = np.stack(
            [np.full(len(own), field.edge + self.ready), 0.4 * place[:, 1]], -1
        )
        target = np.where(fast[:, None], guard, ready)
        action = np.where((can & ~fast)[:, None], strike, (target - own) * self.gain)
        return self._paced(action, view), memory


make = Allround
