"""Gymnasium VectorEnv of many worlds of a scenario with one open seat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from marl_airhockey.build import build_world
from marl_airhockey.envs.attributes import CheckedAttributes
from marl_airhockey.envs.episode_length import SpecifiedLength
from marl_airhockey.envs.infos import infos_of
from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv
from marl_airhockey.envs.pictures import Pictures
from marl_airhockey.envs.reset_options import (
    MASK,
    OPTIONS,
    check_options,
    reset_world,
)
from marl_airhockey.envs.seats import check_one_open
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.checks import check_count
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.sim.world.spaces import action_space, observation_space
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.types import Array, Memory


class AirHockeyVectorEnv(
    CheckedAttributes, SpecifiedLength, VectorEnv[Any, Any, Array]
):
    """Gymnasium VectorEnv of B worlds of a scenario with one open seat.

    - Observations: float32 array (B, D), SI units, ego frame of the seat. They are
      uint8 images with observe="pixels" and dictionaries with goals="dict".
    - Actions: target velocities (B, 2), divided by the top speed, -1 to 1, ego frame.
    - Rewards: sums (B,) of the reward terms; with goals="dict", 1 if the goal is met,
      else 0.
    - Terminations (B,) bool: the episode ended by the rules of the scenario.
    - Truncations (B,) bool: `max_cycles` steps have passed, or a real table interrupted
      the episode.
    - Infos: arrays (B, ...) by name, with the same keys at reset and step, see
      `infos.infos_of`.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        num_envs: Number of worlds, B.
        autoreset_mode: Time of the reset of a world that ended.

            - "NextStep", the default of gymnasium: in the next step, which ignores the
              action of this world.
            - "SameStep": in the same step. ``final_obs`` and ``final_info`` hold the
              observation and the infos of the end, with the masks ``_final_obs`` and
              ``_final_info``.
            - "Disabled": by `reset` with a ``reset_mask``.
        render_mode: "rgb_array" for an image of each world, or None.
        **keywords: Shared keywords, see `make.parallel_env`.

    Raises:
        ValueError: The number of open seats is not one.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - gymnasium declares it so
        "render_modes": ["rgb_array"],
    }

    def __init__(
        self,
        scenario: str | Scenario,
        num_envs: int = 1,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **keywords: Unpack[Keywords],
    ) -> None:
        self.autoreset_mode = _mode_of(autoreset_mode)
        """Time of the reset of a world that ended."""
        same = self.autoreset_mode is AutoresetMode.SAME_STEP
        self.world = build_world(scenario, num_envs, autoreset=same, keywords=keywords)
        check_one_open(self.world)
        self._pictures = Pictures(self.world, render_mode)
        fps = round(1 / self.world.control_dt)
        self.metadata = {
            **AirHockeyEnv.metadata,
            **type(self).metadata,
            "render_fps": fps,
            "autoreset_mode": self.autoreset_mode,
        }
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = observation_space(self.world.observer)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, np.bool_)

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of the (flat part of a single) observation."""
        return self.world.observer.labels

    @property
    def physics(self) -> dict[str, Array]:
        """Physics parameters of the episodes by name (B,); copies."""
        physics = self.world.episode.physics
        return {name: value.copy() for name, value in physics.items()}

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every world.

        Args:
            seed: Seed s, with which world i gets the seed s + i, or a list of B seeds.
                None continues with the current random streams.
            options: Options of `AirHockeyEnv.reset`, with a row for each world. Or
                ``{"reset_mask": (B,) bool}``, True for the worlds to reset. All other
                worlds continue, and no seed may be given.

        Raises:
            ValueError: A seed, mask, option or state is not valid; the message names
                it.
        """
        given = {} if options is None else options
        check_options(self.world, given, (*OPTIONS, MASK))
        mask = given.get(MASK)
        if mask is not None:
            return self._reset_some(np.asarray(mask), seed), self._infos()
        self._ended[:] = False
        own = {name: given[name] for name in OPTIONS if name in given}
        observation = _rows(reset_world(self.world, seed, own))
        if seed is not None:
            first = int(self.world.seeds[0])
            self._np_random, self._np_random_seed = np_random(first)
        self._pictures.follow(range(self.num_envs))
        return observation, self._infos()

    def _reset_some(self, mask: Array, seed: object) -> Any:
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(
                f"reset_mask: expected {self.num_envs} bools, at least one of them True"
            )
        if seed is not None:
            raise ValueError("seed: not possible with a reset_mask; leave it out")
        if not self.world.episode.number.all():
            raise RuntimeError("reset_mask: call reset() without one first")
        self._ended[mask] = False
        worlds = np.flatnonzero(mask)
        self.world.reset_worlds(worlds)
        self._pictures.follow(worlds)
        return _rows(self.world.observation())

    def get_state(self) -> tuple[State, Memory]:
        """Return the true states and the memories of all worlds (B, ...)."""
        return self.world.get_state()

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Any:
        """Continue from states, see `World.set_state`; return the observations."""
        observations = _rows(self.world.set_state(state, memory, worlds))
        self._ended[slice(None) if worlds is None else worlds] = False
        return observations

    def step(self, actions: Array) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        """Move all worlds by one control step.

        Args:
            actions: Target velocities (B, 2), divided by the top speed, ego frame.

        Raises:
            RuntimeError: With "Disabled", an episode has ended and was not reset.
            ValueError: The shape is wrong, or an element is not finite.
        """
        if self._ended.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            raise RuntimeError(
                "step: episodes have ended; call "
                'reset(options={"reset_mask": terminated | truncated}) first'
            )
        given, shape = np.asarray(actions), (self.num_envs, 2)
        if given.shape != shape:
            raise ValueError(f"actions: expected shape {shape}, got {given.shape}")
        result = self.world.step(given[:, None])
        begun = np.flatnonzero(self._ended)
        if len(begun):
            self._begin_anew(begun, result)
        ended = result.terminated | result.truncated
        infos = self._infos(result)
        if result.final_observation is not None:
            final = self._infos(result)
            infos["final_obs"] = _rows(result.final_observation)
            infos["_final_obs"] = infos["_final_info"] = ended
            infos["final_info"] = final
            begun = np.flatnonzero(ended)
        self._pictures.follow(begun)
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            self._ended[:] = ended
        return (
            _rows(result.observation),
            result.reward[:, 0],
            result.terminated,
            result.truncated,
            infos,
        )

    def _begin_anew(self, worlds: Array, result: StepResult) -> None:
        """Begin an episode in worlds (n,) that ended, and clear their results."""
        self.world.reset_worlds(worlds)
        result.clear(worlds)
        result.observation = self.world.observation()

    def _infos(self, result: StepResult | None = None) -> dict[str, Any]:
        result = result or self.world.empty_result()
        eliminated = self.world.eliminated
        if eliminated is None:
            alive = np.ones(self.num_envs, np.bool_)
        else:
            alive = ~eliminated[:, self.world.open[0]]
        return dict(infos_of(result, self.world, alive))

    def render(self) -> tuple[Array, ...]:
        """Return an image (H, W, 3) uint8 of each world."""
        return tuple(self._pictures.take())

    def close_extras(self, **kwargs: Any) -> None:
        """Close the backend and the drivers."""
        self.world.close()


def make_vector(
    scenario: str | Scenario,
    num_envs: int = 1,
    max_episode_steps: int | None = None,
    **given: Any,
) -> AirHockeyVectorEnv:
    """Create the environment; the entry point for ``gymnasium.make_vec``.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        num_envs: Number of worlds, B.
        max_episode_steps: Largest number of control steps of an episode; None or -1
            for the number of the scenario.
        **given: Other arguments of `AirHockeyVectorEnv`.
    """
    envs = AirHockeyVectorEnv(scenario, num_envs, **given)
    if max_episode_steps is not None and max_episode_steps != -1:
        shortened = check_count("max_episode_steps", max_episode_steps)
        envs.max_cycles = min(shortened, envs.max_cycles)
    return envs


def _mode_of(mode: str | AutoresetMode) -> AutoresetMode:
    """Return the mode with a name, such as "SameStep"."""
    modes = {m.value: m for m in AutoresetMode}
    names = [*modes, *(m.name for m in AutoresetMode)]
    if isinstance(mode, AutoresetMode):
        return mode
    if mode in AutoresetMode.__members__:
        return AutoresetMode[mode]
    if mode in modes:
        return modes[mode]
    raise ValueError(f"autoreset_mode: {mode!r}; expected one of {', '.join(names)}")


def _rows(observation: Observation) -> Any:
    """Return the rows (B, ...) of an observation (B, 1, ...) of the only seat."""
    if isinstance(observation, np.ndarray):
        return observation[:, 0]
    return {name: value[:, 0] for name, value in observation.items()}
