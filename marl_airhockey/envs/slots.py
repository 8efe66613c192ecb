"""Vector environment of B worlds with a slot for each open seat."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Protocol, Unpack

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.envs.reset_options import reset_each
from marl_airhockey.envs.seats import check_some_open
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.sim.world.spaces import action_space, observation_space
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.types import Array, Memory


class SlotMirror(Protocol):
    """Mirror of the observations and actions of some slots."""

    def begin(self, slots: Array, count: int) -> None:
        """Choose again in some slots, by index, of ``count`` slots."""

    def observations(self, seen: Array) -> Array:
        """Return the observations (slots, D) as the slots see them."""

    def actions(self, given: Array) -> Array:
        """Return the actions (slots, 2) in ego frames for those of the slots."""


class SlotEnv:
    """Vector environment of B x open seats, world by world, for one shared policy.

    It has the API that learners need and depends on no learning library.
    `AirHockeyVecEnv` is the same for stable-baselines3. Episodes restart immediately.
    Every info is a separate dict with ``TimeLimit.truncated``. At the end of an episode
    it also has ``terminal_observation``, ``is_success``, ``first_shot`` and
    ``episode``.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        num_worlds: Number of worlds, B.
        forms: Observation types of drivers that take open seats later.
        **keywords: Shared keywords, see `make.parallel_env`.

    Raises:
        ValueError: Every seat has a driver.
    """

    def __init__(
        self,
        scenario: str | Scenario,
        num_worlds: int = 1,
        forms: Collection[str] = (),
        **keywords: Unpack[Keywords],
    ) -> None:
        self.world = build_world(scenario, num_worlds, True, keywords, forms)
        check_some_open(self.world)
        self.seats = len(self.world.open)
        self.num_envs = num_worlds * self.seats
        """Number of slots."""
        self.observation_space = observation_space(self.world.observer)
        self.action_space = action_space()
        self.last_terms: dict[str, float] = {}
        """Mean reward terms of the last step, by name."""
        self.penalty: Callable[[Array, Array, Array], Array] | None = None
        """Function that returns the penalty (slots,), which is subtracted from the
        rewards, for actions (slots, 2), excess over the limits (slots,) and ends of
        episodes (slots,); None for no penalty."""
        self.mirror: SlotMirror | None = None
        """Mirror of some slots in training; None for none."""
        self.ended = np.zeros(0, np.int64)
        """Indices of the worlds that restarted in the last step."""
        self._began = time.time()
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, np.int64)

    @property
    def unwrapped(self) -> SlotEnv:
        """The environment itself, as in gymnasium."""
        return self

    def seed(self, seed: int) -> None:
        """Set the seed of world i to seed + i for the next reset."""
        self.world.seed(seed)

    def reset(
        self,
        seed: Sequence[int] | None = None,
        options: Sequence[Mapping[str, Any]] = (),
    ) -> Any:
        """Begin an episode in every world; return the observations (slots, ...).

        Args:
            seed: Seed of each world; None continues with the current random streams.
            options: Options of each world, see `reset_options.reset_world`.
        """
        self._returns[:], self._lengths[:] = 0.0, 0
        observation = reset_each(self.world, seed, options)
        self._all_began()
        if self.mirror is not None:
            self.mirror.begin(np.arange(self.num_envs), self.num_envs)
        return self.of_slots(observation)

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Any:
        """Continue from states, see `World.set_state`; return the observations."""
        return self.of_slots(self.world.set_state(state, memory, worlds))

    def step(self, actions: Array) -> tuple[Any, Array, Array, list[dict[str, Any]]]:
        """Move all worlds by one control step.

        Args:
            actions: Target velocities (slots, 2), divided by the top speed, ego frames.

        Returns:
            Observations (slots, ...), rewards (slots,) float32, ends of episodes
            (slots,) bool, and an info for each slot.

        Raises:
            ValueError: The shape is wrong, or an element is not finite.
        """
        given, shape = np.asarray(actions), (self.num_envs, 2)
        if given.shape != shape:
            raise ValueError(f"actions: expected shape {shape}, got {given.shape}")
        if self.mirror is not None:
            given = self.mirror.actions(given)
        every = self._of_worlds(given)
        result = self.world.step(every)
        reward = self._pick(result.reward).astype(np.float32)
        self.last_terms = {k: float(v.mean()) for k, v in result.terms.items()}
        self._returns += reward
        self._lengths += 1
        ended = result.terminated | result.truncated
        done = self._done(ended)
        if self.penalty is not None:
            excess = self._pick(result.violation)[:, -1]
            penalty = self.penalty(self._pick(every), excess, done)
            reward -= penalty.astype(np.float32)
            self.last_terms["action_penalty"] = -float(penalty.mean())
        infos = [{"TimeLimit.truncated": False} for _ in range(self.num_envs)]
        self.ended = np.flatnonzero(ended)
        if result.final_observation is not None:
            self._fill_infos(infos, np.flatnonzero(done), result)
            self._returns[done], self._lengths[done] = 0.0, 0
            self._restarted(self.ended, result)
            if self.mirror is not None:
                self.mirror.begin(np.flatnonzero(done), self.num_envs)
        return self.of_slots(result.observation), reward, done, infos

    def _fill_infos(
        self, infos: list[dict[str, Any]], slots: Array, result: StepResult
    ) -> None:
        """Replace the infos of slots (n,) whose episode ended."""
        assert result.final_observation is not None
        final = self.of_slots(result.final_observation)
        success = self._pick(result.success)
        for i in slots.tolist():
            world = self.world_of(i)
            cut = bool(result.truncated[world] and not result.terminated[world])
            infos[i] = {
                "terminal_observation": _row(final, i),
                "TimeLimit.truncated": cut,
                "is_success": bool(success[i]),
                "first_shot": bool(result.first_shot[world]),
                "episode": {
                    "r": float(self._returns[i]),
                    "l": int(self._lengths[i]),
                    "t": time.time() - self._began,
                },
            }

    def of_slots(self, observation: Observation) -> Any:
        """Reshape observations (B, seats, ...) to (slots, ...)."""
        if isinstance(observation, np.ndarray):
            rows = self._pick(observation)
            return rows if self.mirror is None else self.mirror.observations(rows)
        return {k: self._pick(v) for k, v in observation.items()}

    def _of_worlds(self, actions: Array) -> Array:
        """Reshape actions (slots, 2) to (B, seats, 2)."""
        return actions.reshape(-1, self.seats, 2)

    def _pick(self, rows: Array) -> Array:
        """Reshape rows (B, seats, ...) to (slots, ...)."""
        return rows.reshape(self.num_envs, *rows.shape[2:])

    def _done(self, ended: Array) -> Array:
        """Return the ends of slots (slots,), given the ends of worlds (B,)."""
        return np.repeat(ended, self.seats)

    def world_of(self, slot: int) -> int:
        """Return the index of a slot's world."""
        return slot // self.seats

    def _all_began(self) -> None:
        """Do nothing; called when an episode begins in every world."""
        return None

    def _restarted(self, worlds: Array, last: StepResult) -> None:
        """Do nothing; called when some worlds, by index, restarted after a step."""
        return None

    def close(self) -> None:
        """Close the backend and the drivers."""
        self.world.close()


def _row(observations: Any, i: int) -> Any:
    if isinstance(observations, dict):
        return {name: value[i] for name, value in observations.items()}
    return observations[i]
