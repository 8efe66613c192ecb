"""PettingZoo ParallelEnv of one world."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
from pettingzoo import ParallelEnv

from marl_airhockey.build import build_world
from marl_airhockey.envs.attributes import CheckedAttributes
from marl_airhockey.envs.episode_length import EpisodeLength
from marl_airhockey.envs.infos import info_of
from marl_airhockey.envs.reset_options import reset_world
from marl_airhockey.envs.seats import check_some_open
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.spaces import action_space, observation_space
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.types import Array, Memory

Dicts = tuple[
    dict[str, Any],
    dict[str, float],
    dict[str, bool],
    dict[str, bool],
    dict[str, dict[str, Any]],
]

WINDOW = importlib.util.find_spec("pygame") is not None
"""True if pygame is installed, which windows need; the extra "play" contains it."""


class AirHockeyEnv(CheckedAttributes, EpisodeLength, ParallelEnv[str, Any, Any]):  # type: ignore[misc]
    """PettingZoo ParallelEnv of one world, whose open seats are the agents.

    The agents are ``paddle_0``, ``paddle_1`` and so on, without the seats that have a
    driver. For each agent:

    - Observation: float32 array (D,), SI units, ego frame of the seat. It is a stack
      of uint8 images with observe="pixels" and a dictionary with goals="dict".
    - Action: target velocity (2,), divided by the top speed, -1 to 1, ego frame.
    - Reward: sum of the reward terms; with goals="dict", 1 if the goal is met, else 0.
    - Termination: the episode ended by the rules of the scenario.
    - Truncation: `max_cycles` steps have passed, or a real table interrupted the
      episode.
    - Info: numbers with the same keys at reset and step, see `infos.info_of`.

    All agents stay to the end of the episode and end together. The environment can be
    copied and pickled at any moment. The copy is independent and has no window.

    Args:
        scenario: Name, code, class or object, see `registry.find_scenario`.
        render_mode: "rgb_array", "human" or None for no images.
        viewpoint: Camera of images, "top" or a viewpoint of the backend.
        **keywords: Shared keywords, see `make.parallel_env`.

    Raises:
        ValueError: Every seat has a driver.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - PettingZoo declares it so
        "name": "marl_airhockey",
        # Environment checkers try every mode in this list.
        "render_modes": ["human", "rgb_array"] if WINDOW else ["rgb_array"],
        "is_parallelizable": True,
        "render_fps": 20,
    }

    def __init__(
        self,
        scenario: str | Scenario,
        render_mode: str | None = None,
        viewpoint: str = "top",
        **keywords: Unpack[Keywords],
    ) -> None:
        self.world = build_world(scenario, 1, autoreset=False, keywords=keywords)
        check_some_open(self.world)
        fps = round(1 / self.world.control_dt)
        game = self.world.scenario
        name = f"{game.name}_v{game.version}"
        self.metadata = {**type(self).metadata, "name": name, "render_fps": fps}
        self.render_mode = render_mode
        self._renderer = None
        if render_mode is not None:
            from marl_airhockey.sim.render.renderer import Renderer

            title = game.name.replace("_", " ")
            self._renderer = Renderer(
                self.world, render_mode, title, viewpoint=viewpoint
            )
        self.possible_agents = [f"paddle_{i}" for i in self.world.open]
        self.agents: list[str] = []
        observer = self.world.observer
        self._observation_spaces = {
            agent: observation_space(observer) for agent in self.possible_agents
        }
        self._action_spaces = {agent: action_space() for agent in self.possible_agents}
        self.observation_spaces = self._observation_spaces
        self.action_spaces = self._action_spaces
        self.state_space = self.world.critic_state_space
        self.np_random = np.random.default_rng()

    @property
    def teams(self) -> dict[int, list[str]]:
        """Names of all seats by team, including seats with a driver."""
        teams: dict[int, list[str]] = {}
        for i, seat in enumerate(self.world.scene.seats):
            teams.setdefault(seat.team, []).append(f"paddle_{i}")
        return teams

    @property
    def group_map(self) -> dict[str, list[str]]:
        """Agents by team, for TorchRL's ``group_map`` and the policies of RLlib."""
        names = {f"team_{team}": agents for team, agents in self.teams.items()}
        mine = {
            k: [a for a in v if a in self.possible_agents] for k, v in names.items()
        }
        return {name: agents for name, agents in mine.items() if agents}

    def _check_agent(self, agent: str) -> None:
        """Raise a KeyError if a name is not an agent."""
        if agent not in self._action_spaces:
            raise KeyError(unknown_name("agent", agent, self.possible_agents))

    def observation_space(self, agent: str) -> Any:
        """Return the observation space of an agent, the same object in every call."""
        self._check_agent(agent)
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        """Return the action space of an agent, the same object in every call."""
        self._check_agent(agent)
        return self._action_spaces[agent]

    def observation_labels(self, agent: str) -> tuple[str, ...]:
        """Return the name of each element of the (flat part of the) observation."""
        self._check_agent(agent)
        return self.world.observer.labels

    @property
    def state_labels(self) -> tuple[str, ...]:
        """Name of each element of `state`."""
        return self.world.critic_state_labels

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin an episode; the same seed gives the same episodes.

        Args:
            seed: Seed of this and the following episodes; None continues with the
                current random streams.
            options: ``{"state": State, "memory": Memory}`` to begin in a given state,
                see `set_state`. The memory may be left out.

        Raises:
            ValueError: An option is misspelt, or a state is not valid; the message
                names it.
        """
        observation = reset_world(self.world, seed, options)
        if seed is not None:
            self.np_random = np.random.default_rng(seed)
        self.agents = self.possible_agents[:]
        self._begin_pictures()
        return self._dict(observation), self._infos(self.world.empty_result())

    @property
    def physics(self) -> dict[str, float]:
        """Physics parameters of the episode by name.

        Raises:
            RuntimeError: `reset`, which samples them, was not called.
        """
        if not self.world.episode.number[0]:
            raise RuntimeError("physics: call reset() first, which samples them")
        return {k: float(v[0]) for k, v in self.world.episode.physics.items()}

    def get_state(self) -> tuple[State, Memory]:
        """Return the true state and the memory, the arguments of `set_state`.

        The arrays are new and have no axis of worlds.
        """
        state, memory = self.world.get_state()
        return state.map(lambda x: x[0]), {name: x[0] for name, x in memory.items()}

    def set_state(self, state: State, memory: Memory | None = None) -> dict[str, Any]:
        """Continue from a state, see `World.set_state`; return the observations.

        All agents are active again, even if the episode had ended.
        """
        observation = self.world.set_state(state, memory)
        self.agents = self.possible_agents[:]
        self._begin_pictures()
        return self._dict(observation)

    def _begin_pictures(self) -> None:
        if self._renderer is not None:
            self._renderer.begin()
        self._watch()

    def step(self, actions: Mapping[str, Any]) -> Dicts:
        """Move by one control step.

        Raises:
            RuntimeError: `reset` was not called, or the episode has ended.
            ValueError: An agent is missing or unknown, or an action is not valid; the
                message names it.
        """
        if not self.agents:
            if not actions and self.world.episode.number[0]:
                return {}, {}, {}, {}, {}
            if self.world.episode.number[0]:
                raise RuntimeError("step: the episode has ended; call reset()")
            raise RuntimeError("step: call reset() first; no episode is running")
        result = self.world.step(self._array(actions))
        agents, reward = self.agents, result.reward
        terminated, truncated = result.terminated.item(0), result.truncated.item(0)
        outcome = (
            self._dict(result.observation),
            {agent: reward.item(i) for i, agent in enumerate(agents)},
            dict.fromkeys(agents, terminated),
            dict.fromkeys(agents, truncated),
            self._infos(result),
        )
        if terminated or truncated:
            self.agents = []
        self._watch()
        return outcome

    def _watch(self) -> None:
        """Extend the trails of an image, and in human mode show it."""
        if self._renderer is not None:
            self._renderer.follow()

    def _array(self, actions: Mapping[str, Any]) -> Array:
        """Return the actions (1, open, 2) of a dictionary with one for each agent."""
        agents = self.agents
        if not isinstance(actions, Mapping):
            raise ValueError(
                f"actions: expected a dict with an action for each of {agents}, got "
                f"{type(actions).__name__}"
            )
        if actions.keys() != self._action_spaces.keys():
            missing = sorted(set(agents) - set(actions))
            extra = sorted(set(actions) - set(agents))
            raise ValueError(f"actions: missing agents {missing}, extra {extra}")
        array = np.empty((1, len(agents), 2))
        for i, agent in enumerate(agents):
            action = np.asarray(actions[agent])
            if action.shape != (2,) or action.dtype.kind not in "fiu":
                raise ValueError(
                    f"actions[{agent!r}]: expected 2 numbers, got shape {action.shape} "
                    f"of dtype {action.dtype}"
                )
            array[0, i] = action
        return array

    def _dict(self, observation: Any) -> dict[str, Any]:
        agents = enumerate(self.possible_agents)
        if isinstance(observation, dict):
            return {a: {k: v[0, i] for k, v in observation.items()} for i, a in agents}
        return {a: observation[0, i] for i, a in agents}

    def _infos(self, result: StepResult) -> dict[str, dict[str, Any]]:
        world, eliminated = self.world, self.world.eliminated
        out = [] if eliminated is None else eliminated[0, world.open].tolist()
        return {
            agent: info_of(result, world, i, not (out and out[i]))
            for i, agent in enumerate(self.agents)
        }

    def state(self) -> Array:
        """Return the true state for a critic (S,), see `global_state.GlobalState`.

        Raises:
            RuntimeError: `reset` was not called.
        """
        if not self.world.episode.number[0]:
            raise RuntimeError("state: call reset() first; no episode is running")
        return np.asarray(self.world.critic_state()[0])

    def render(self) -> Array | None:
        """Return an image (H, W, 3) uint8 for "rgb_array"; None for "human"."""
        if self._renderer is None:
            raise RuntimeError('render: create it with render_mode="rgb_array"')
        return self._renderer.show()

    def close(self) -> None:
        """Close the window, the backend and the drivers."""
        if self._renderer is not None:
            self._renderer.close()
        self.world.close()
