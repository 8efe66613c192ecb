"""Stable-baselines3 VecEnv over B worlds: a slot for each open seat of each."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from typing import Any, Unpack

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from marl_airhockey.contracts.scenario import GoalScenario, Scenario
from marl_airhockey.core.state import State
from marl_airhockey.envs.pictures import Pictures
from marl_airhockey.envs.seats import check_some_open
from marl_airhockey.envs.spaces import action_space, observation_space
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.build import Keywords, build_world
from marl_airhockey.world.observer import Observation
from marl_airhockey.world.step_result import StepResult


class AirHockeyVecEnv(VecEnv):
    """Slots of SB3 for B x open seats, world by world; episodes restart at once.

    Done slots get ``terminal_observation``, ``TimeLimit.truncated``, ``is_success``,
    ``first_shot`` and ``episode``; all others share one empty dict.

    Args:
        scenario: its name, or a scenario object.
        num_worlds: B.
        render_mode: None or "rgb_array": pictures of all worlds, tiled.
        forms: see `build.build_world`.
        **keywords: see `build.build_world`.
    """

    def __init__(
        self,
        scenario: str | Scenario,
        num_worlds: int = 1,
        render_mode: str | None = None,
        forms: Collection[str] = (),
        **keywords: Unpack[Keywords],
    ) -> None:
        self.world = build_world(scenario, num_worlds, True, keywords, forms)
        check_some_open(self.world)
        self.seats = len(self.world.open)
        self.render_mode = render_mode
        self._pictures = Pictures(self.world, render_mode)
        self.last_terms: dict[str, float] = {}
        """Mean reward terms of the last step, by name."""
        self.penalty: Callable[[Array, Array, Array], Array] | None = None
        """Penalty (slots,) of actions (slots, 2), excess of limits (slots,) and ends of
        episodes (slots,), which is taken off the rewards; none at first."""
        self._began = time.time()
        self._nothing: dict[str, Any] = {}
        slots = num_worlds * self.seats
        self._returns, self._lengths = np.zeros(slots), np.zeros(slots, np.int64)
        self._actions = np.zeros((num_worlds, self.seats, 2))
        super().__init__(slots, observation_space(self.world.observer), action_space())
        fps: Any = round(1 / self.world.control_dt)
        self.metadata["render_fps"] = fps

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of the (flat part of a slot's) observation."""
        return self.world.observer.labels

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Give world i the seed + i at the next reset."""
        if seed is not None:
            self.world.seed(seed)
        return [seed] * self.num_envs

    def reset(self) -> Any:
        """Begin an episode in every world."""
        self._returns[:], self._lengths[:] = 0.0, 0
        observation = self._slots(self.world.reset())
        self._pictures.follow(range(self.world.num_worlds))
        return observation

    def get_state(self) -> tuple[State, Memory]:
        """Return the true states and the memories of all worlds, (B, ...)."""
        return self.world.get_state()

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Any:
        """Go on from given states, see `World.set_state`; return the observations."""
        return self._slots(self.world.set_state(state, memory, worlds))

    def step_async(self, actions: Array) -> None:
        """Take the actions (slots, 2)."""
        given, shape = np.asarray(actions), (self.num_envs, 2)
        if given.shape != shape:
            raise ValueError(f"actions: expected shape {shape}, got {given.shape}")
        self._actions = given.reshape(-1, self.seats, 2)

    def step_wait(self) -> Any:
        """Move all worlds by one control step."""
        result = self.world.step(self._actions)
        reward = self._pick(result.reward).astype(np.float32)
        self.last_terms = {k: float(v.mean()) for k, v in result.terms.items()}
        self._returns += reward
        self._lengths += 1
        ended = result.terminated | result.truncated
        success, done = self._pick(result.success), self._done(ended)
        if self.penalty is not None:
            excess = self._pick(result.violation)[:, -1]
            penalty = self.penalty(self._pick(self._actions), excess, done)
            reward -= penalty.astype(np.float32)
            self.last_terms["action_penalty"] = -float(penalty.mean())
        infos = [self._nothing] * self.num_envs
        if result.final_observation is not None:
            final = self._slots(result.final_observation)
            for i in np.flatnonzero(done).tolist():
                world = self._world(i)
                infos[i] = {
                    "terminal_observation": _row(final, i),
                    "TimeLimit.truncated": bool(result.truncated[world]),
                    "is_success": bool(success[i]),
                    "first_shot": bool(result.first_shot[world]),
                    "episode": {
                        "r": float(self._returns[i]),
                        "l": int(self._lengths[i]),
                        "t": time.time() - self._began,
                    },
                }
            self._returns[done], self._lengths[done] = 0.0, 0
            self._restarted(np.flatnonzero(ended), result)
        self._pictures.follow(np.flatnonzero(ended))
        return self._slots(result.observation), reward, done, infos

    def _slots(self, observation: Observation) -> Any:
        if isinstance(observation, np.ndarray):
            return self._pick(observation)
        return {k: self._pick(v) for k, v in observation.items()}

    def _pick(self, rows: Array) -> Array:
        """(slots, ...) of (B, seats, ...)."""
        return rows.reshape(self.num_envs, *rows.shape[2:])

    def _done(self, ended: Array) -> Array:
        """(slots,) of (B,)."""
        return np.repeat(ended, self.seats)

    def _world(self, slot: int) -> int:
        return slot // self.seats

    def _restarted(self, worlds: Array, last: StepResult) -> None:
        """Note that some worlds, by index, have begun anew after their last step."""
        return None

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
        self.world.close()

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
        """Tell for each slot that it is not wrapped."""
        return [False for _ in self._get_indices(indices)]


def _row(observations: Any, i: int) -> Any:
    if isinstance(observations, dict):
        return {name: value[i] for name, value in observations.items()}
    return observations[i]
