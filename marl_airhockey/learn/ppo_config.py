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
from marl_airhockey.sim.contracts.image_form import shows_camera, shows_images
from marl_airhockey.sim.core.profiles import SUFFIX, find_profile


@dataclass(frozen=True, kw_only=True)
class PPOConfig(SelfPlayConfig):
    """Settings of a PPO run, which ``--set`` changes.

    Raises:
        ValueError: A setting is invalid. The message names it.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        *SelfPlayConfig.MAY_BE_ZERO,
        "num_env_runners",
        "curriculum",
        "ent_coef",
        "log_std_init",
    )
    """Names of the number settings that may be 0."""
    engine: str = "torch"
    """Implementation: "torch" or "sb3" in this process, "rllib" in many processes, or
    "device" for worlds on ``device``, too."""
    num_env_runners: int = 0
    """Number of processes in which rllib steps worlds, a divisor of ``num_worlds``; 0
    for the process of the learner. Other engines only have 0."""
    cuda_graph: bool = True
    """True to repeat the kernels of a rollout as one CUDA graph. Only with the engine
    device, on a GPU, with an even ``n_steps``."""
    init: str = ""
    """Folder of a run of the same engine and network size whose weights the training
    begins with; "" for new weights. Not with rllib."""
    curriculum: float = 0.0
    """Share of the ranges of starts and goals, around their middles, with which
    training begins, 0 to 1. The ranges widen with the success. 0 for the whole ranges.
    Only for tasks with the engine torch."""
    n_steps: int
    """Number of steps of each world in a rollout, above 0. ``batch_size`` has to divide
    the number of steps of all learners in a rollout."""
    n_epochs: int
    """Number of epochs of gradient descent on a rollout, above 0."""
    max_learning_rate: float
    """Highest learning rate, to which a low KL divergence increases it, above 0."""
    target_kl: float
    """Target of the KL divergence, above 0. The learning rate is decreased if the
    divergence is above twice the target, and increased if it is below half of it."""
    gae_lambda: float
    """Lambda of generalized advantage estimation, above 0; 1 for whole returns."""
    clip_range: float
    """Largest deviation of the probability ratio from 1 in the clipped loss, above
    0."""
    ent_coef: float
    """Weight of the entropy of the actions in the loss; 0 for none."""
    max_grad_norm: float
    """Norm to which gradients are clipped, above 0."""
    log_std_init: float
    """Initial log standard deviation of the actions, any number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.engine != "sb3" and self.needs_sb3(self.observe, self.options):
            raise ValueError(
                f"engine: {self.engine} learns from flat observations; use sb3 for "
                'observe="pixels" and goals="dict"'
            )
        if shows_camera(self.observe):
            raise ValueError(
                f"observe: PPO does not learn from a camera ({self.observe}); clone "
                'recordings with algo="bc", or choose observe="pixels"'
            )
        if self.self_play and shows_images(self.observe):
            raise ValueError(
                f"observe: self-play does not learn from images ({self.observe}); "
                "choose the drivers of the other seats, as in drivers={'paddle_1': "
                "'striker'}, or another observation type"
            )
        if not 0 <= self.curriculum <= 1:
            raise ValueError(f"curriculum: {self.curriculum} must be in 0 .. 1")
        if self.curriculum and (self.engine != "torch" or self.self_play):
            raise ValueError("curriculum: only tasks with the engine torch have one")
        if self.exploiters and (self.engine != "torch" or not self.self_play):
            raise ValueError("exploiters: only games with the engine torch have them")
        if self.engine == "device":
            self._check_device()
        if self.engine == "rllib":
            self._check_rllib()
        elif self.num_env_runners:
            raise ValueError("num_env_runners: only the engine rllib has env runners")
        if self.rollout % self.batch_size:
            raise ValueError(
                f"batch_size: {self.batch_size} must divide the steps of a rollout, "
                f"n_steps times the learners in num_worlds worlds, {self.rollout}"
            )

    def exploiter(self, learner: Path, number: int) -> PPOConfig:
        """Return the configuration of an exploiter.

        Args:
            learner: Folder of the learner's weights, see `engine.save_weights`.
            number: Number of the exploiter, from 1.
        """
        return replace(
            self,
            total_steps=int(self.total_steps * self.exploiter_share / self.exploiters),
            seed=self.seed + 1000 * number,
            init=str(learner),
            evaluations=1,
            **only_against(str(learner / "last.npz")),
        )

    @staticmethod
    def needs_sb3(observe: str, options: Mapping[str, Any]) -> bool:
        """Return True if only the engine sb3 learns from an observation type."""
        return shows_images(observe) or options.get("goals") == "dict"

    def _check_device(self) -> None:
        """Check that no setting needs the worlds of the CPU."""
        names = "mirrored_share", "action_rate_weight", "action_jerk_weight"
        used = [n for n in (*names, "cost_weight") if getattr(self, n)]
        if used:
            raise ValueError(f"{', '.join(used)}: the engine device does not have them")
        if self.self_play and self.self_play_fraction != 1.0:
            raise ValueError(
                "self_play_fraction: with the engine device the learner plays all "
                "seats; set it to 1"
            )

    def _check_rllib(self) -> None:
        if self.device != "cpu":
            raise ValueError(f"device: {self.device!r}; rllib learns on the cpu here")
        if self.init:
            raise ValueError("init: rllib cannot begin with the weights of a run")
        runners = self.num_env_runners
        if runners < 0 or self.num_worlds % max(runners, 1):
            raise ValueError(
                f"num_env_runners: {runners} must divide num_worlds, {self.num_worlds}"
            )

    @property
    def rollout(self) -> int:
        """Number of steps between two updates. Training ends with a whole rollout."""
        return self.n_steps * self.slots


def only_against(player: str) -> dict[str, Any]:
    """Return the settings of a training against one player only.

    Args:
        player: Name of a driver or path of a policy.
    """
    return {
        "opponents": [player],
        "eval_opponents": [player],
        "self_play_fraction": 0.0,
        "scripted_fraction": 1.0,
        "snapshots": 1,
        "exploiters": 0,
    }


def preset(scenario: str, changes: Mapping[str, Any] | None = None) -> PPOConfig:
    """Return the preset of a scenario with changed settings.

    Raises:
        ValueError: A scenario or a setting is unknown, or a setting is invalid.
    """
    if not isinstance(scenario, str):
        raise ValueError(
            "scenario: a resumed run needs its name; put the class into a file "
            'and give "my_task.py", "my_task.py:Class" or "package.module:Class"'
        )
    place, colon, name = scenario.partition(":")
    if place.endswith(".py"):  # A run can be resumed from any working directory.
        scenario = f"{Path(place).expanduser().resolve()}{colon}{name}"
    changes = changes or {}
    game = find_scenario(scenario, **changes.get("options", {}))
    text = resources.files(__package__).joinpath("presets.toml").read_text()
    presets = tomllib.loads(text)
    for agent, driver in changes.get("drivers", {}).items():
        if not isinstance(driver, str):
            raise ValueError(
                f"drivers: {agent}: a resumed run needs the names of its drivers; "
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
    alone = merged.get("drivers") or merged.get("engine", "torch") != "torch"
    if alone and "exploiters" not in changes:
        merged["exploiters"] = 0
    config = PPOConfig(**{**merged, "scenario": scenario})
    number, each = _evaluations(config, changes)
    return replace(config, evaluations=number, eval_episodes=each)


EVALUATION_SHARE = 0.2
"""Largest CPU time of the evaluations of a game, as a share of that of learning."""
EVALUATION_COST = 1.5
"""CPU time of a control step in an evaluation of a game, in steps of learning."""
FEWEST_GAMES = 20
"""Number of games against each opponent below which the number of evaluations is
reduced instead."""


def _evaluations(config: PPOConfig, changes: Mapping[str, Any]) -> tuple[int, int]:
    """Return number and size of the evaluations that fit the training of a game.

    Settings that were given are not changed. Tasks have short episodes and no limit.
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
    """Return the range of a servo's lag, from none to the longest of the profile.

    The policy can then also control arms that lag less, such as the simulated arm.
    """
    return {"servo_time": [0.0, find_profile(profile).ranges["servo_time"][1]]}
