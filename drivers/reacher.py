"""Driver that moves to the goal; baseline of the reach tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View, length


@dataclass
class Reacher(Driver):
    """Driver that moves to the goal.

    If the goal has a target velocity, the paddle starts a run-up from behind the goal.

    Raises:
        ValueError: The scenario has no goal.
    """

    needs_goal: ClassVar[bool] = True
    gain: float = 4.0
    """Commanded speed per distance to the target, 1/s."""
    run_up: float = 0.22
    """Duration of the run-up before the goal, s."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        if "goal" not in view.scenario_memory:
            raise ValueError(
                "reacher: this scenario has no goal; choose one with a goal"
            )
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
