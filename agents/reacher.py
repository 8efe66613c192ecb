"""Go to the goal, with its velocity if it has one: a baseline for the reach tasks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


@dataclass
class Reacher(Driver):
    """Steers to the goal; a wanted velocity is met by a run-up behind the goal.

    Raises:
        ValueError: a scenario without a goal.
    """

    gain: float = 4.0
    """1/s: asked speed for a metre of distance."""
    run_up: float = 0.22
    """s before the goal at which the run begins."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        if "goal" not in view.scenario_memory:
            raise ValueError("reacher: this scenario has no goal to reach")
        own = view.state.paddle[:, view.seat]
        top = view.top_speed[:, None]
        goal = view.scenario_memory["goal"]
        if "goal_velocity" not in view.scenario_memory:
            return (goal - own) * self.gain / top, memory
        wanted = view.scenario_memory["goal_velocity"]
        way = goal - own
        along = (way * wanted).sum(-1) / (wanted * wanted).sum(-1)
        aside = length(way - along[:, None] * wanted)
        run = (along > -0.1) & (along < 1.3 * self.run_up) & (aside < 0.03)
        behind = goal - self.run_up * wanted
        steer = wanted + (way - along[:, None] * wanted) * self.gain
        prepare = (behind - own) * self.gain
        return np.where(run[:, None], steer, prepare) / top, memory


make = Reacher
