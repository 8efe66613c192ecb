"""Driver of games that guards its own goal and shoots at the open goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, View, tactics


@dataclass
class Allround(tactics.Scripted):
    """Driver of games that guards its own goal and shoots at the open goal.

    It strikes a puck if its paddle can be behind the puck in time.
    """

    depth: float = 0.02
    """Distance of the guarded line from the near edge of the workspace, m."""
    ready: float = 0.07
    """Distance of the waiting position from the own end, m."""
    gain: float = 16.0
    """Commanded speed per distance to the target, 1/s."""
    patience: float = 0.3
    """Time until a strike above which it waits instead, s."""
    brave: float = 1.6
    """Speed of an approaching puck from which it guards, m/s."""
    shot: float = 1.0
    """Speed of a strike, as a share of its largest speed."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own, (pace, lag) = view.state.paddle[:, view.seat], self._skill
        if not view.state.bodies.pucks:
            return np.zeros_like(own), memory
        field = tactics.Field.of(view.scene, view.seat)
        aim = tactics.open_goal(view, field)
        strike, due = tactics.attack(view, field, aim, pace, lag, self.shot)
        place, motion = tactics.nearest_puck(view, field, lag)
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
