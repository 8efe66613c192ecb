"""Stable-baselines3 VecEnv over B worlds: a slot for each open seat of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from marl_airhockey.contracts.scenario import GoalScenario
from marl_airhockey.core.state import State
from marl_airhockey.envs.pictures import Pictures
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.types import Array, Memory


class AirHockeyVecEnv(VecEnv):
    """Slots as an environment of stable-baselines3, see `SlotEnv`.

    Args:
        slots: Worlds and their slots.
        render_mode: None or "rgb_array": pictures of all worlds, tiled.
    """

    def __init__(self, slots: SlotEnv, render_mode: str | None = None) -> None:
        self.slots, self.world = slots, slots.world
        self.render_mode = render_mode
        self._pictures = Pictures(self.world, render_mode)
        self._actions = np.zeros((slots.num_envs, 2))
        super().__init__(slots.num_envs, slots.observation_space, slots.action_space)
        fps: Any = round(1 / self.world.control_dt)
        self.metadata["render_fps"] = fps

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of the (flat part of a slot's) observation."""
        return self.world.observer.labels

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Give world i the seed + i at the next reset."""
        if seed is not None:
            self.slots.seed(seed)
        return [seed] * self.num_envs

    def reset(self) -> Any:
        """Begin an episode in every world."""
        observation = self.slots.reset()
        self._pictures.follow(range(self.world.num_worlds))
        return observation

    def get_state(self) -> tuple[State, Memory]:
        """Return the true states and the memories of all worlds, (B, ...)."""
        return self.world.get_state()

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Any:
        """Continue from given states, see `World.set_state`; return observations."""
        return self.slots.set_state(state, memory, worlds)

    def step_async(self, actions: Array) -> None:
        """Take the actions (slots, 2)."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Move all worlds by one control step."""
        result = self.slots.step(self._actions)
        self._pictures.follow(self.slots.ended)
        return result

    def compute_reward(self, achieved: Array, desired: Array, info: Any) -> Array:
        """(...) float32: 1 where the goal is met; for goals="dict"."""
        scenario = self.world.scenario
        assert isinstance(scenario, GoalScenario)
        return np.asarray(scenario.shown_reward(achieved, desired), np.float32)

    def get_images(self) -> Sequence[Array | None]:
        """Return a picture (H, W, 3) uint8 of each world."""
        return self._pictures.take()

    def close(self) -> None:
        """Close the physics."""
        self.slots.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the environment, once for each slot."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the environment."""
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method once for each of some slots."""
        method = getattr(self, method_name)
        return [method(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each slot: none is wrapped."""
        return [False for _ in self._get_indices(indices)]
