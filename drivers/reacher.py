"""Reacher: moves to the goal, with its velocity if any; baseline of the reach tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


@dataclass
class Reacher(Driver):
    """Driver to the goal, with a run-up from behind it for a wanted velocity.

    Raises:
        ValueError: a scenario without a goal.
    """

    needs_goal: ClassVar[bool] = True
    gain: float = 4.0
    """Commanded speed per distance (1/s)."""
    run_up: float = 0.22
    """Time before the goal at which the run-up begins (s)."""

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
