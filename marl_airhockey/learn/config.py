"""Training configurations: a preset for each scenario, options on top, as TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

from marl_airhockey.core.errors import unknown_name
from marl_airhockey.core.profiles import SUFFIX, find_profile
from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.policies.runs import check_run_format
from marl_airhockey.policies.trust import is_trusted_code, require_trust
from marl_airhockey.registry import find_scenario, runs_code
from marl_airhockey.world.build import Keywords

OPPONENTS = ("random", "goalkeeper", "striker", "allround", "allround:strength=fair")
RIVALS = ("random", "goalkeeper", "striker", "allround")


@dataclass(frozen=True, kw_only=True)
class TrainConfig(RunConfig):
    """Settings of a PPO run; the fields are the options of ``--set``.

    Its ``total_steps`` are of single worlds, summed over all worlds.

    Raises:
        ValueError: a value that makes no sense, named.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = (
        "seed",
        "num_env_runners",
        "ent_coef",
        "log_std_init",
        "action_rate_weight",
        "action_jerk_weight",
        "cost_weight",
        "mirror",
        "script_share",
    )
    training_options: dict[str, Any] = field(default_factory=dict)
    """Like `options`, for training alone and not for evaluations; `options` comes
    first"""
    training_physics: dict[str, Any] = field(default_factory=dict)
    """The same for `physics`"""
    engine: str = "torch"
    """"torch" or "sb3" in this process, or "rllib" over many."""
    num_env_runners: int = 0
    """Number of processes in which rllib steps worlds; 0 for the learner's"""

    init: str = ""
    """Folder of a run of the same engine and network size, to begin with its weights"""

    num_worlds: int
    n_steps: int
    """Steps of each world in a rollout"""
    n_epochs: int
    highest_rate: float
    """Highest learning rate, to which a low KL divergence raises it"""
    target_kl: float
    """KL divergence; the rate is lowered above twice it, raised below half of it"""
    gae_lambda: float
    clip_range: float
    ent_coef: float
    max_grad_norm: float
    log_std_init: float
    action_rate_weight: float = 0.0
    """Weight of the squared change of the action, taken off the reward in training"""
    action_jerk_weight: float = 0.0
    """Weight of the squared second difference of the action, likewise"""
    cost_weight: float = 0.0
    """Weight of ``cost``, the sum of exceeded limits, likewise"""
    mirror: float = 0.5
    """Share of the worlds of a game in which the learner plays all seats"""
    opponents: list[str] = field(default_factory=lambda: list(OPPONENTS))
    """Drivers that the learner plays against in games"""
    script_share: float = 0.5
    """Share of the other worlds' games that are against `opponents`"""
    snapshots: int = 40
    """Number of times that the learner is added to the pool of opponents"""
    pool: int = 16
    """Most snapshots in the pool"""
    priority: float = 2.0
    """Power of an opponent's share of won games, by which it is drawn"""
    opponent_pace: float = 0.1
    """In half of the games against others they move at a share of the speed that they
    command, drawn from here to 1: who never gets past a good one learns nothing"""
    rivals: list[str] = field(default_factory=lambda: list(RIVALS))
    """Drivers that evaluations of games are against"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.drivers and self.self_play:
            raise ValueError(
                f"drivers: self-play needs all seats of {self.scenario!r} open; to "
                "learn against somebody, fill all seats of the other teams"
            )
        for name in ("mirror", "script_share", "opponent_pace"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: {getattr(self, name)} must be in 0 .. 1")
        if self.engine != "sb3" and self.needs_sb3(self.observe, self.options):
            raise ValueError(
                f"engine: {self.engine} learns from flat observations; take sb3 for "
                'observe="pixels" and goals="dict"'
            )
        if self.engine == "rllib":
            self._check_rllib()
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

    @cached_property
    def self_play(self) -> bool:
        """True if seats of more than one team are open: the learner plays them all."""
        return len(set(self._open_teams)) > 1

    @cached_property
    def _open_teams(self) -> list[int]:
        seats = enumerate(find_scenario(self.scenario, **self.options).scene.seats)
        return [s.team for i, s in seats if f"paddle_{i}" not in self.drivers]

    @property
    def slots(self) -> int:
        """Number of seats that the learner plays, over all worlds."""
        seats, teams = len(self._open_teams), len(set(self._open_teams))
        if teams == 1:
            return self.num_worlds * seats
        mirrored = round(self.mirror * self.num_worlds)
        return mirrored * seats + (self.num_worlds - mirrored) * (seats // teams)

    @property
    def rollout(self) -> int:
        """Number of steps between two updates; training ends with a whole one."""
        return self.n_steps * self.slots

    @property
    def training_keywords(self) -> Keywords:
        """Keywords of the environments of training."""
        physics = {**self.training_physics, **self.physics}
        options = {**self.training_options, **self.options}
        return {**self.keywords, "physics": physics, "options": options}


def preset(scenario: str, changes: Mapping[str, Any] | None = None) -> TrainConfig:
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
    game = find_scenario(scenario, **(changes or {}).get("options", {}))
    text = resources.files(__package__).joinpath("presets.toml").read_text()
    presets = tomllib.loads(text)
    for agent, driver in (changes or {}).get("drivers", {}).items():
        if not isinstance(driver, str):
            raise ValueError(
                f"drivers: {agent}: a run is resumed by the names of its drivers; "
                "give a name, a path or code such as my_driver.py"
            )
    known = [f.name for f in fields(TrainConfig)]
    for name in changes or {}:
        if name not in known:
            raise ValueError(unknown_name("setting", name, known))
    merged = {**presets["defaults"], **presets.get(game.name, {})}
    sensed = merged.pop("sensed", {})
    profile = (changes or {}).get("profile", "ideal")
    if profile.endswith(SUFFIX):
        profile = str(Path(profile).expanduser().resolve())
        changes = {**(changes or {}), "profile": profile}
    if profile != "ideal":
        lags = _lags(profile)
        merged |= {"observe": "estimate", "training_physics": lags, **sensed}
    merged |= changes or {}
    form = merged.get("observe", "velocity"), merged.get("options", {})
    if TrainConfig.needs_sb3(*form):
        merged = {"engine": "sb3", **merged}
    config = TrainConfig(**{**merged, "scenario": scenario})
    number, each = _evaluations(config, changes or {})
    return replace(config, evaluations=number, eval_episodes=each)


EVALUATION_SHARE = 0.2
"""Most CPU time of a game's evaluations, as a share of that of learning"""
EVALUATION_COST = 1.5
"""CPU time of a control step of an evaluation's game, in steps of learning"""
FEWEST_GAMES = 20
"""Games against each rival below which there are fewer evaluations instead"""


def _evaluations(config: TrainConfig, changes: Mapping[str, Any]) -> tuple[int, int]:
    """Return number and games of the evaluations that a game's training can afford.

    What is set stays as it is. A task's episodes are short and need no bound.
    """
    number, each = config.evaluations, config.eval_episodes
    if not config.self_play:
        return number, each
    game = find_scenario(config.scenario, **config.options)
    steps = game.seconds / config.control_dt * len(config.rivals)
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


def _refuse_code(path: Path, data: Mapping[str, Any]) -> None:
    """Ask before a configuration, maybe somebody else's, runs code that it names."""
    named = [data.get("scenario", ""), *dict(data.get("drivers", {})).values()]
    named += [*data.get("opponents", []), *data.get("rivals", [])]
    found = [t for t in map(str, named) if runs_code(t) and not is_trusted_code(t)]
    if found:
        require_trust(path, code=f"the name of Python code, {found[0]}")


def read_settings(path: Path) -> dict[str, Any]:
    """Return the settings in the ``config.toml`` of a run.

    Raises:
        ValueError: not such a file, one of a run of another format, or one that names
            Python code and is not trusted.
    """
    try:
        data = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path} is no training configuration: {error}") from error
    found = data.pop("format", 1)
    if "scenario" in data:
        check_run_format(path.parent, found)
    _refuse_code(path, data)
    return data


def load_config(path: Path) -> TrainConfig:
    """Read what `RunConfig.to_toml` wrote of a run of PPO.

    Raises:
        ValueError: see `read_settings`, or a run of another algorithm.
    """
    data = read_settings(path)
    if "algo" in data:
        raise ValueError(f"{path.parent}: a run of {data['algo']}, not of PPO")
    try:
        return TrainConfig(**data)
    except TypeError as error:
        raise ValueError(f"{path} is no training configuration: {error}") from error
