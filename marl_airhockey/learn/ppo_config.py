"""Settings of PPO, and the preset of each scenario."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

from marl_airhockey.learn.self_play_config import SelfPlayConfig
from marl_airhockey.learn.settings import check_names
from marl_airhockey.registry import find_scenario
from marl_airhockey.sim.core.profiles import SUFFIX, find_profile


@dataclass(frozen=True, kw_only=True)
class PPOConfig(SelfPlayConfig):
    """Settings of a PPO run; the fields are the options of ``--set``.

    Its ``total_steps`` are of single worlds, summed over all worlds.

    Raises:
        ValueError: A value that makes no sense, named.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        *SelfPlayConfig.MAY_BE_ZERO,
        "num_env_runners",
        "curriculum",
        "ent_coef",
        "log_std_init",
    )
    engine: str = "torch"
    """"torch" or "sb3" in this process, or "rllib" over many."""
    num_env_runners: int = 0
    """Number of processes in which rllib steps worlds; 0 for the learner's"""
    init: str = ""
    """Folder of a run of the same engine and network size, to begin with its weights"""
    curriculum: float = 0.0
    """Share of the ranges of starts and goals, about their middles, with which training
    begins; they widen as it succeeds. 0: whole from the beginning. Engine torch"""
    n_steps: int
    """Steps of each world in a rollout"""
    n_epochs: int
    """Epochs of gradient descent on a rollout"""
    max_learning_rate: float
    """Highest learning rate, to which a low KL divergence raises it"""
    target_kl: float
    """KL divergence; the rate is lowered above twice it, raised below half of it"""
    gae_lambda: float
    clip_range: float
    ent_coef: float
    max_grad_norm: float
    log_std_init: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.engine != "sb3" and self.needs_sb3(self.observe, self.options):
            raise ValueError(
                f"engine: {self.engine} learns from flat observations; take sb3 for "
                'observe="pixels" and goals="dict"'
            )
        if not 0 <= self.curriculum <= 1:
            raise ValueError(f"curriculum: {self.curriculum} must be in 0 .. 1")
        if self.curriculum and (self.engine != "torch" or self.self_play):
            raise ValueError("curriculum: only tasks on the engine torch have one")
        if self.engine == "rllib":
            self._check_rllib()
        elif self.num_env_runners:
            raise ValueError("num_env_runners: only the engine rllib has runners")
        if self.rollout % self.batch_size:
            raise ValueError(
                f"batch_size: {self.batch_size} must divide n_steps x learners in "
                f"num_worlds worlds, {self.rollout}"
            )

    @staticmethod
    def needs_sb3(observe: str, options: Mapping[str, Any]) -> bool:
        """Return True if only the engine sb3 learns from observations of a form."""
        return observe == "pixels" or options.get("goals") == "dict"

    def _check_rllib(self) -> None:
        if self.init:
            raise ValueError("init: rllib cannot begin with the weights of a run")
        runners = self.num_env_runners
        if runners < 0 or self.num_worlds % max(runners, 1):
            raise ValueError(
                f"num_env_runners: {runners} must divide num_worlds, {self.num_worlds}"
            )

    @property
    def rollout(self) -> int:
        """Number of steps between two updates; training ends with a whole one."""
        return self.n_steps * self.slots


def preset(scenario: str, changes: Mapping[str, Any] | None = None) -> PPOConfig:
    """Return the preset of a scenario with changes on top.

    Raises:
        ValueError: an unknown scenario or field, or a bad value.
    """
    if not isinstance(scenario, str):
        raise ValueError(
            "scenario: a run is resumed by its name; put the class into a "
            'file and give "my_task.py", "my_task.py:Class" or "package.module:Class"'
        )
    place, colon, name = scenario.partition(":")
    if place.endswith(".py"):  # A run goes on from any folder.
        scenario = f"{Path(place).expanduser().resolve()}{colon}{name}"
    changes = changes or {}
    game = find_scenario(scenario, **changes.get("options", {}))
    text = resources.files(__package__).joinpath("presets.toml").read_text()
    presets = tomllib.loads(text)
    for agent, driver in changes.get("drivers", {}).items():
        if not isinstance(driver, str):
            raise ValueError(
                f"drivers: {agent}: a run is resumed by the names of its drivers; "
                "give a name, a path or code such as my_driver.py"
            )
    check_names(PPOConfig, changes)
    merged = {**presets["defaults"], **presets.get(game.name, {})}
    sensed = merged.pop("sensed", {})
    profile = changes.get("profile", "ideal")
    if profile.endswith(SUFFIX):
        profile = str(Path(profile).expanduser().resolve())
        changes = {**changes, "profile": profile}
    if profile != "ideal":
        lags = _lags(profile)
        merged |= {"observe": "estimate", "training_physics": lags, **sensed}
    merged |= changes
    form = merged.get("observe", "velocity"), merged.get("options", {})
    if PPOConfig.needs_sb3(*form):
        merged = {"engine": "sb3", **merged}
    config = PPOConfig(**{**merged, "scenario": scenario})
    number, each = _evaluations(config, changes)
    return replace(config, evaluations=number, eval_episodes=each)


EVALUATION_SHARE = 0.2
"""Most CPU time of a game's evaluations, as a share of that of learning"""
EVALUATION_COST = 1.5
"""CPU time of a control step of an evaluation's game, in steps of learning"""
FEWEST_GAMES = 20
"""Games against each opponent below which there are fewer evaluations instead"""


def _evaluations(config: PPOConfig, changes: Mapping[str, Any]) -> tuple[int, int]:
    """Return number and games of the evaluations that a game's training can afford.

    What is set stays as it is. A task's episodes are short and need no bound.
    """
    number, each = config.evaluations, config.eval_episodes
    if not config.self_play:
        return number, each
    game = find_scenario(config.scenario, **config.options)
    steps = game.seconds / config.control_dt * len(config.eval_opponents)
    games = EVALUATION_SHARE * config.total_steps / (EVALUATION_COST * steps)
    if "evaluations" not in changes:
        number = min(number, max(int(games / FEWEST_GAMES), 1))
    if "eval_episodes" not in changes:
        each = min(each, max(int(games / number), 1))
    return number, each


def _lags(profile: str) -> dict[str, Any]:
    """Return a servo's lag from none to the profile's longest.

    So a policy plays on arms that lag less as well, the simulated one among them.
    """
    return {"servo_time": [0.0, find_profile(profile).ranges["servo_time"][1]]}
