"""Gymnasium spaces of actions, observations and the state for a critic."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from gymnasium import spaces

from marl_airhockey.sim.contracts.image_form import (
    OWN,
    PIXELS,
    image_form,
    shows_camera,
    shows_images,
)
from marl_airhockey.sim.contracts.scenario import GoalScenario
from marl_airhockey.sim.world.global_state import GlobalState
from marl_airhockey.sim.world.observer import Observer
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.sim.world.world import World


def action_space() -> spaces.Box:
    """Return Box(-1, 1, (2,)): target velocity divided by the top speed, ego frame."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def observation_space(observer: Observer, observe: str | None = None) -> Any:
    """Return the Box of an observation, or with goals="dict" the Dict."""
    observe = observe or observer.observe
    if shows_images(observe):
        pixels = spaces.Box(0, 255, image_form(observe).shape, np.uint8)
        if not shows_camera(observe):
            return pixels
        table, scope = observer.scenario.scene.table, observer.layout_of(observe).scope
        reach = np.abs(table.vertices).max()
        high = np.array([reach, reach, *[2.0 * scope.top_speed] * 2], np.float32)
        own = spaces.Box(-high, high, dtype=np.float32)
        return spaces.Dict({PIXELS: pixels, OWN: own})
    layout = observer.layout_of(observe)
    flat = spaces.Box(layout.low, layout.high, dtype=np.float32)
    scenario = observer.scenario
    if scenario.goals == "flat" or not isinstance(scenario, GoalScenario):
        return flat
    high = np.array(scenario.goal_bounds, np.float32)
    goal = [spaces.Box(-high, high, dtype=np.float32) for _ in range(2)]
    return spaces.Dict(observation=flat, achieved_goal=goal[0], desired_goal=goal[1])


class WorldSpaces:
    """Mixin of worlds: spaces of an open seat, and the state for a critic."""

    observer: Observer

    @property
    def observation_space(self) -> Any:
        """Space of the observation of an open seat."""
        return observation_space(self.observer)

    @property
    def action_space(self) -> spaces.Box:
        """Space of the action of a seat."""
        return action_space()

    @cached_property
    def _global_state(self) -> GlobalState:
        return GlobalState(cast("World", self))

    @property
    def critic_state_space(self) -> spaces.Box:
        """Space of a row of `critic_state`."""
        return self._global_state.space

    @property
    def critic_state_labels(self) -> tuple[str, ...]:
        """Name of each element of a row of `critic_state`."""
        return self._global_state.labels

    def critic_state(self) -> Array:
        """Return the true state for a critic of all seats (B, S), float32, a new array.

        `global_state.GlobalState` defines the elements.
        """
        return self._global_state.read()
