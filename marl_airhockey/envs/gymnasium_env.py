"""Gymnasium Env of a scenario with one open seat."""

from __future__ import annotations

from typing import Any, Unpack

import gymnasium
import numpy as np

from marl_airhockey.envs.attributes import CheckedAttributes
from marl_airhockey.envs.episode_length import SpecifiedLength
from marl_airhockey.envs.pettingzoo_env import AirHockeyEnv
from marl_airhockey.envs.seats import check_one_open
from marl_airhockey.sim.contracts.scenario import GoalScenario, Scenario
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array, Memory


class AirHockeySingleEnv(CheckedAttributes, SpecifiedLength, gymnasium.Env[Any, Array]):
    """Gymnasium Env of a scenario with one open seat.

    - Observation: float32 array (D,), SI units, ego frame of the seat. It is a stack
      of uint8 images with observe="pixels".
    - Action: target velocity (2,), divided by the top speed, -1 to 1, ego frame.
    - Reward: sum of the reward terms of the scenario.
    - Termination: the episode ended by the rules of the scenario.
    - Truncation: `max_cycles` steps have passed, or a real table interrupted the
      episode.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        render_mode: "rgb_array", "human" or None for no images.
        viewpoint: Camera of images, "top" or a viewpoint of the backend.
        **keywords: Shared keywords, see `make.parallel_env`.

    Raises:
        ValueError: The number of open seats is not one.
    """

    metadata: dict[str, Any] = AirHockeyEnv.metadata

    def __init__(
        self,
        scenario: str | Scenario,
        render_mode: str | None = None,
        viewpoint: str = "top",
        **keywords: Unpack[Keywords],
    ) -> None:
        self.parallel = AirHockeyEnv(scenario, render_mode, viewpoint, **keywords)
        self.world = self.parallel.world
        check_one_open(self.world)
        self.agent = self.parallel.possible_agents[0]
        self.render_mode = render_mode
        self.metadata = self.parallel.metadata
        self.observation_space = self.parallel.observation_space(self.agent)
        self.action_space = self.parallel.action_space(self.agent)

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of the (flat part of the) observation."""
        return self.parallel.observation_labels(self.agent)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; `AirHockeyEnv.reset` explains the options."""
        observation, info = self.parallel.reset(seed, options)
        super().reset(seed=seed)
        return observation[self.agent], self._named(info)

    @property
    def physics(self) -> dict[str, float]:
        """Physics parameters of the episode by name."""
        return self.parallel.physics

    def get_state(self) -> tuple[State, Memory]:
        """Return the true state and the memory, the arguments of `set_state`."""
        return self.parallel.get_state()

    def set_state(self, state: State, memory: Memory | None = None) -> Any:
        """Continue from a state, see `World.set_state`; return the observation."""
        return self.parallel.set_state(state, memory)[self.agent]

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Move by one control step; `infos.info_of` lists the keys of the info."""
        seen, reward, ended, cut, info = self.parallel.step({self.agent: action})
        me = self.agent
        return seen[me], reward[me], ended[me], cut[me], self._named(info)

    def _named(self, infos: dict[str, dict[str, Any]]) -> dict[str, Any]:
        info = infos[self.agent]
        # Stable-baselines3 reads the success under this name.
        info["is_success"] = info["success"]
        return info

    def render(self) -> Any:
        """Return an image (H, W, 3) uint8 for "rgb_array"; None for "human"."""
        return self.parallel.render()

    def close(self) -> None:
        """Close the window, the backend and the drivers."""
        self.parallel.close()


class AirHockeyGoalEnv(AirHockeySingleEnv):
    """Gymnasium Env with goals="dict", for hindsight experience replay.

    It differs from `AirHockeySingleEnv` in the following:

    - Observation: dictionary of float32 arrays, ``observation`` (D,),
      ``achieved_goal`` (G,) and ``desired_goal`` (G,).
    - Reward: 1 if the achieved goal meets the desired goal, else 0.
    - Termination: the goal is met, or the puck was removed from the table.
    """

    def compute_reward(self, achieved: Array, desired: Array, info: Any) -> Array:
        """Return the rewards of goals, 1 if met and 0 if not (...), float32.

        Args:
            achieved: Achieved goals (..., G).
            desired: Desired goals (..., G).
            info: Infos, which are not used.
        """
        scenario = self.world.scenario
        assert isinstance(scenario, GoalScenario)
        return np.asarray(scenario.shown_reward(achieved, desired), np.float32)


def make_single(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AirHockeySingleEnv:
    """Create the environment; the entry point for ``gymnasium.make``."""
    dicts = keywords.get("goals") == "dict"
    kind = AirHockeyGoalEnv if dicts else AirHockeySingleEnv
    return kind(scenario, render_mode, viewpoint, **keywords)
