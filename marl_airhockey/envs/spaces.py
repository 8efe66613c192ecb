"""Gymnasium spaces of actions and observations."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from marl_airhockey.contracts.observable import FRAMES
from marl_airhockey.contracts.scenario import GoalScenario
from marl_airhockey.world.observer import PIXELS, Observer


def action_space() -> spaces.Box:
    """Wanted velocity as a fraction of top speed, ego frame: Box(-1, 1, (2,))."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def observation_space(observer: Observer, observe: str | None = None) -> Any:
    """Box, or the Dict of goals="dict"."""
    observe = observe or observer.observe
    if observe == "pixels":
        return spaces.Box(0, 255, (PIXELS, PIXELS, FRAMES), np.uint8)
    layout = observer.layout_of(observe)
    flat = spaces.Box(layout.low, layout.high, dtype=np.float32)
    scenario = observer.scenario
    if scenario.goals == "flat" or not isinstance(scenario, GoalScenario):
        return flat
    high = np.array(scenario.goal_bounds, np.float32)
    goal = [spaces.Box(-high, high, dtype=np.float32) for _ in range(2)]
    return spaces.Dict(observation=flat, achieved_goal=goal[0], desired_goal=goal[1])
