"""Gymnasium Env: one open seat, all others driven."""

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
    """Scenario as its only open seat sees it.

    Args:
        scenario: its name, or a scenario object.
        render_mode: None, "rgb_array" or "human".
        viewpoint: Viewpoint of its pictures: "top", or one of the backend's.
        **keywords: see `make.build_world`.

    Raises:
        ValueError: not exactly one seat is open.
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
        """Begin an episode; options as those of `AirHockeyEnv.reset`."""
        observation, info = self.parallel.reset(seed, options)
        super().reset(seed=seed)
        return observation[self.agent], self._named(info)

    @property
    def physics(self) -> dict[str, float]:
        """Physical parameters of the episode by name."""
        return self.parallel.physics

    def get_state(self) -> tuple[State, Memory]:
        """Return the true state and the scenario's memory, which `set_state` takes."""
        return self.parallel.get_state()

    def set_state(self, state: State, memory: Memory | None = None) -> Any:
        """Go on from a given state, see `World.set_state`; return the observation."""
        return self.parallel.set_state(state, memory)[self.agent]

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Move by one control step; see `AirHockeyEnv` for the info."""
        seen, reward, ended, cut, info = self.parallel.step({self.agent: action})
        me = self.agent
        return seen[me], reward[me], ended[me], cut[me], self._named(info)

    def _named(self, infos: dict[str, dict[str, Any]]) -> dict[str, Any]:
        info = infos[self.agent]
        # The name under which stable-baselines3 looks for it.
        info["is_success"] = info["success"]
        return info

    def render(self) -> Any:
        """Return a picture (H, W, 3) uint8 for "rgb_array"."""
        return self.parallel.render()

    def close(self) -> None:
        """Close the window and the physics."""
        self.parallel.close()


class AirHockeyGoalEnv(AirHockeySingleEnv):
    """Goal environment for hindsight relabelling, with goals="dict"."""

    def compute_reward(self, achieved: Array, desired: Array, info: Any) -> Array:
        """(...) float32: 1 where the goal is met; of goals (..., goal) alone."""
        scenario = self.world.scenario
        assert isinstance(scenario, GoalScenario)
        return np.asarray(scenario.shown_reward(achieved, desired), np.float32)


def make_single(
    scenario: str | Scenario,
    render_mode: str | None = None,
    viewpoint: str = "top",
    **keywords: Unpack[Keywords],
) -> AirHockeySingleEnv:
    """Build the environment, as ``gymnasium.make`` asks for it."""
    dicts = keywords.get("goals") == "dict"
    kind = AirHockeyGoalEnv if dicts else AirHockeySingleEnv
    return kind(scenario, render_mode, viewpoint, **keywords)
