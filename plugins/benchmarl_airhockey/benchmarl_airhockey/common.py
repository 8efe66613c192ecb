"""Tasks of BenchMARL: worlds of a game, a group for each team, the true state."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import torch
from benchmarl.environments.common import Task, TaskClass
from benchmarl.utils import _read_yaml_config
from torchrl.envs import EnvBase

import marl_airhockey as ah
from marl_airhockey.registry import make_scenario
from marl_airhockey.sim.render.renderer import Renderer

CONF = Path(__file__).parent / "conf"
"""Folder of the configurations, in the layout of BenchMARL."""
NAME = "airhockey"
SHARED = ("profile", "opponent", "max_cycles")
"""Fields of all configurations. The others are options of the game."""
WIDTH = 440
"""Width of the images of evaluations, pixels."""


class AirHockeyClass(TaskClass):
    """Game of BenchMARL with a group ``team_k`` for each team that learns.

    With an opponent, only the agents of team 0 learn.
    """

    def get_env_fun(
        self,
        num_envs: int,
        continuous_actions: bool,
        seed: int | None,
        device: torch.device | str,
    ) -> Callable[[], EnvBase]:
        """Return a function that builds ``num_envs`` worlds as one environment."""
        game, config = self.name.lower(), dict(self.config)
        shared = {name: config.pop(name, None) for name in SHARED}
        keywords = {"options": config, "profile": shared["profile"] or "ideal"}
        if shared["max_cycles"]:
            keywords["max_cycles"] = shared["max_cycles"]
        if shared["opponent"]:
            seats = make_scenario(game).scene.seats
            others = [f"paddle_{i}" for i, seat in enumerate(seats) if seat.team]
            keywords["drivers"] = dict.fromkeys(others, shared["opponent"])

        def build() -> EnvBase:
            env = ah.make_torchrl(game, num_envs, **keywords).to(device)
            env.set_seed(seed)
            return env

        return build

    def supports_continuous_actions(self) -> bool:
        """Return True, because actions are velocities."""
        return True

    def supports_discrete_actions(self) -> bool:
        """Return False."""
        return False

    def max_steps(self, env: EnvBase) -> int:
        """Return the length of an episode, control steps."""
        return int(env.world.max_cycles)

    def has_render(self, env: EnvBase) -> bool:
        """Return True."""
        return True

    def group_map(self, env: EnvBase) -> dict[str, list[str]]:
        """Return the agents of each group."""
        return dict(env.group_map)

    def observation_spec(self, env: EnvBase) -> Any:
        """Return the spec of the agents' observations, without the state."""
        spec = env.full_observation_spec_unbatched.clone()
        del spec["state"]
        return spec

    def info_spec(self, env: EnvBase) -> None:
        """Return None, because there are no infos."""

    def state_spec(self, env: EnvBase) -> Any:
        """Return the spec of the state, for critics."""
        spec = env.full_observation_spec_unbatched.clone()
        for group in env.group_map:
            del spec[group]
        return spec

    def action_spec(self, env: EnvBase) -> Any:
        """Return the spec of the actions."""
        return env.full_action_spec_unbatched

    def action_mask_spec(self, env: EnvBase) -> None:
        """Return None, because every action is allowed."""

    @staticmethod
    def env_name() -> str:
        """Return the name of the environment in configurations and results."""
        return NAME

    @staticmethod
    def render_callback(experiment: Any, env: EnvBase, data: Any) -> torch.Tensor:
        """Return an image (H, W, 3) uint8 of the first world."""
        renderer = Renderer(env.world, "rgb_array", experiment.task.name.lower())
        return torch.as_tensor(renderer.take_picture(WIDTH).copy())


class AirHockeyTask(Task):
    """Games with several agents."""

    DUEL = None
    DOUBLES = None
    FREE_FOR_ALL = None
    RALLY = None
    TEAM_JUGGLE = None

    @staticmethod
    def associated_class() -> type[TaskClass]:
        """Return the class of the tasks."""
        return AirHockeyClass

    @property
    def config_class(self) -> type:
        """Dataclass of the configuration."""
        return import_module(f"{__package__}.{self.name.lower()}").TaskConfig

    def get_from_yaml(self, path: str | None = None) -> TaskClass:
        """Return the task with the configuration of a file; None for the default.

        Raises:
            TypeError: The file has an unknown field, or lacks one.
        """
        file = path or str(CONF / "task" / NAME / f"{self.name.lower()}.yaml")
        return self.get_task(vars(self.config_class(**_read_yaml_config(file))))
