"""Gymnasium VectorEnv over B worlds: no dicts of agents, no copies in between."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.state import State
from marl_airhockey.envs.gymnasium_env import check_one_open
from marl_airhockey.envs.reset_options import reset_world
from marl_airhockey.envs.spaces import action_space, observation_space
from marl_airhockey.types import Array, Memory
from marl_airhockey.world.build import Keywords, build_world
from marl_airhockey.world.observer import Observation
from marl_airhockey.world.step_result import StepResult


class AirHockeyVectorEnv(VectorEnv[Any, Any, Array]):
    """Worlds of a scenario with one open seat, which restart in the same step.

    ``infos`` are dicts of arrays (B, ...). Where an episode ended, ``final_obs`` and
    ``final_info`` hold its end, with the masks ``_final_obs`` and ``_final_info``.

    Args:
        scenario: its name, or a scenario object.
        num_envs: B.
        **keywords: see `make.build_world`.
    """

    def __init__(
        self, scenario: str | Scenario, num_envs: int = 1, **keywords: Unpack[Keywords]
    ) -> None:
        self.world = build_world(scenario, num_envs, autoreset=True, keywords=keywords)
        check_one_open(self.world)
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.num_envs = num_envs
        self.render_mode = None
        self.single_observation_space = observation_space(self.world.observer)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every world; world i gets seed + i.

        Options as those of `AirHockeyEnv.reset`, with a row for each world.
        """
        if seed is not None and not isinstance(seed, (int, np.integer)):
            raise ValueError("seed: give one number; world i gets seed + i")
        return _rows(reset_world(self.world, seed, options)), {}

    def get_state(self) -> tuple[State, Memory]:
        """Return the true states and the memories of all worlds, (B, ...)."""
        return self.world.get_state()

    def set_state(
        self, state: State, memory: Memory | None = None, worlds: Array | None = None
    ) -> Any:
        """Go on from given states, see `World.set_state`; return the observations."""
        return _rows(self.world.set_state(state, memory, worlds))

    def step(self, actions: Array) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        """Move all worlds by one control step; actions (B, 2)."""
        result = self.world.step(np.asarray(actions)[:, None])
        info = self._info(result)
        if result.final_observation is not None:
            done = result.terminated | result.truncated
            info["final_obs"] = _rows(result.final_observation)
            info["_final_obs"] = info["_final_info"] = done
            info["final_info"] = self._info(result)
        return (
            _rows(result.observation),
            result.reward[:, 0],
            result.terminated,
            result.truncated,
            info,
        )

    @staticmethod
    def _info(result: StepResult) -> dict[str, Any]:
        return {
            "reward": {name: term[:, 0] for name, term in result.terms.items()},
            "applied_action": result.applied_action[:, 0],
            "success": result.success[:, 0],
            "cost": result.cost[:, 0],
        }

    def close_extras(self, **kwargs: Any) -> None:
        """Close the physics."""
        self.world.close()


def _rows(observation: Observation) -> Any:
    """Return the only seat's rows (B, ...) of an observation (B, 1, ...)."""
    if isinstance(observation, np.ndarray):
        return observation[:, 0]
    return {name: value[:, 0] for name, value in observation.items()}
