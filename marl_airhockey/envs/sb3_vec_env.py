"""Stable-baselines3 VecEnv of B worlds with a slot for each open seat."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv
from marl_airhockey.envs.pictures import Pictures
from marl_airhockey.envs.slot import Slot
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.sim.contracts.scenario import GoalScenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array, Memory


class AirHockeyVecEnv(VecEnv):
    """Stable-baselines3 VecEnv with a slot for each open seat of B worlds.

    It returns the same as a ``DummyVecEnv`` of one single environment per slot, each in
    a ``Monitor``. The slots of a world follow each other.

    - Observations: float32 array (slots, D), SI units, ego frames. They are uint8
      images with observe="pixels" and dictionaries with goals="dict".
    - Actions: target velocities (slots, 2), divided by the top speed, -1 to 1, ego
      frames.
    - Rewards: sums (slots,) of the reward terms; with goals="dict", 1 if the goal is
      met, else 0.
    - Ends (slots,) bool: the episode was terminated or truncated. The world restarts in
      the same step.
    - Termination: the episode ended by the rules of the scenario.
    - Truncation: `max_cycles` steps have passed. ``TimeLimit.truncated`` in the info is
      then True.
    - Infos: a dictionary for each slot, see `SlotEnv`.

    `get_attr`, `set_attr` and `env_method` access the attributes and methods of `Slot`.

    Args:
        slots: Worlds and their slots.
        render_mode: "rgb_array" for one image with tiles of all worlds, or None.
    """

    def __init__(self, slots: SlotEnv, render_mode: str | None = None) -> None:
        self.slots, self.world = slots, slots.world
        self.render_mode = render_mode
        metadata: dict[str, Any] = {
            **AirHockeyEnv.metadata,
            "render_modes": ["rgb_array"],
            "render_fps": round(1 / self.world.control_dt),
        }
        self.metadata, self._pictures = metadata, Pictures(self.world, render_mode)
        self._actions = np.zeros((slots.num_envs, 2))
        self._slots: dict[int, Slot] = {}
        super().__init__(slots.num_envs, slots.observation_space, slots.action_space)
        self.metadata = metadata

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of the (flat part of a slot's) observation."""
        return self.world.observer.labels

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seed of world i to seed + i for the next reset.

        Args:
            seed: Seed of the first world; None samples one from NumPy's global
                generator.

        Returns:
            Seed of the world of each slot (slots,).
        """
        first = super().seed(seed)[0]
        assert first is not None
        self._seeds = [first + self.slots.world_of(i) for i in range(self.num_envs)]
        return self._seeds

    def reset(self) -> Any:
        """Begin an episode in every world, with the seeds and options that are set.

        Raises:
            ValueError: Slots of one world have different options, or an option is not
                valid, see `AirHockeyEnv.reset`.
        """
        given = self._seeds[0] is not None
        seeds = [s for s in self._of_worlds(self._seeds) if s is not None]
        options = self._of_worlds(self._options)
        self._reset_seeds()
        self._reset_options()
        observation = self.slots.reset(seeds if given else None, options)
        self._pictures.follow(range(self.world.num_worlds))
        return observation

    def _of_worlds(self, every: Sequence[Any]) -> list[Any]:
        """Return the value for each world, from one value for each slot."""
        if len(every) != self.num_envs:
            raise ValueError(f"options: {len(every)} given for {self.num_envs} slots")
        worlds: dict[int, Any] = {}
        for i, given in enumerate(every):
            first = worlds.setdefault(self.slots.world_of(i), given)
            if first is not given and repr(first) != repr(given):
                raise ValueError("options: slots of one world need equal options")
        return [worlds[world] for world in range(self.world.num_worlds)]

    def set_options(
        self, options: Sequence[Mapping[str, Any]] | Mapping[str, Any] | None = None
    ) -> None:
        """Set the options of the next reset.

        Args:
            options: Options for all slots, or a list with options for each slot, see
                `AirHockeyEnv.reset`.
        """
        super().set_options(options)  # type: ignore[arg-type]

    def get_state(self) -> tuple[State, Memory]:
        """Return the true states and the memories of all worlds (B, ...)."""
        return self.world.get_state()

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Any:
        """Continue from states, see `World.set_state`; return the observations."""
        return self.slots.set_state(state, memory, worlds)

    def step_async(self, actions: Array) -> None:
        """Store the actions (slots, 2) of the next step."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Move all worlds by one control step."""
        result = self.slots.step(self._actions)
        self._pictures.follow(self.slots.ended)
        return result

    def compute_reward(self, achieved: Array, desired: Array, info: Any) -> Array:
        """Return the rewards of goals (..., G) with goals="dict" (...), float32."""
        scenario = self.world.scenario
        assert isinstance(scenario, GoalScenario)
        return np.asarray(scenario.shown_reward(achieved, desired), np.float32)

    def get_images(self) -> Sequence[Array | None]:
        """Return an image (H, W, 3) uint8 of each slot's world, or None for each."""
        if self.render_mode is None:
            warnings.warn(
                'render_mode is None; create it with "rgb_array"',
                stacklevel=2,
            )
            return [None] * self.num_envs
        pictures = self._pictures.take()
        return [pictures[self.slots.world_of(i)] for i in range(self.num_envs)]

    def close(self) -> None:
        """Close the backend and the drivers."""
        self.slots.close()

    def _chosen(self, indices: Any) -> list[Slot]:
        every = range(self.num_envs)
        chosen = [every[i] for i in self._get_indices(indices)]
        return [self._slots.setdefault(i, Slot(self, i)) for i in chosen]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of some slots."""
        return [getattr(slot, attr_name) for slot in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of some slots, see `attributes.CheckedAttributes`."""
        for slot in self._chosen(indices):
            setattr(slot, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of some slots."""
        chosen = self._chosen(indices)
        return [getattr(slot, method_name)(*args, **kwargs) for slot in chosen]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return True for ``Monitor``, because infos contain its ``episode``."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]
