"""Train a policy with PPO (stable-baselines3) over B worlds in one process.

A run is a folder: ``config.toml`` (resolved), ``versions.json``, ``progress.csv`` and
tensorboard events, ``evaluations.csv``, ``best.zip`` and ``last.zip``, and
``state.json`` from which a killed run goes on.
"""

from __future__ import annotations

import csv
import json
import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import (
    CSVOutputFormat,
    Logger,
    TensorBoardOutputFormat,
)

from marl_airhockey.learn.config import TrainConfig, load_config
from marl_airhockey.learn.network import FixedScale
from marl_airhockey.learn.policy import Policy
from marl_airhockey.make import make_sb3_vec
from marl_airhockey.match import Result, evaluate
from marl_airhockey.vector_sb3 import AirHockeyVecEnv

EVAL_SEED = 1_000_000
"""First seed of the evaluations during training."""
COLUMNS = (
    "steps",
    "cpu_seconds",
    "wall_seconds",
    "success",
    "success_sampled",
    "first_shot",
    "return",
    "length",
    "hits",
)
Report = Callable[[int, int, dict[str, float]], None]
"""Called with steps done, steps in all, and the newest evaluation."""


class Rate:
    """Learning rate that follows the KL divergence and fades to a tenth.

    The divergence of an update should lie near its target: above twice of it the rate
    is divided by 1.5, below half of it multiplied (after Schulman et al., 2017, who
    adapt their penalty so).
    """

    def __init__(self, config: TrainConfig, rate: float) -> None:
        self.rate, self._config = rate, config

    def __call__(self, remaining: float) -> float:
        """The rate when a share ``remaining`` of the training is left."""
        return self.rate * (0.1 + 0.9 * remaining)

    def adapt(self, divergence: float) -> None:
        """Take the divergence of the last update."""
        config = self._config
        if divergence > 2 * config.target_kl:
            self.rate = max(self.rate / 1.5, 0.03 * config.learning_rate)
        elif divergence < config.target_kl / 2:
            self.rate = min(self.rate * 1.5, config.highest_rate)


@dataclass
class Progress:
    """Where a run stands; ``state.json``."""

    steps: int = 0
    cpu_seconds: float = 0.0
    wall_seconds: float = 0.0
    rate: float = 0.0
    best: tuple[float, float] = (-1.0, float("-inf"))
    """Success and return of the best evaluation."""

    def save(self, path: Path) -> None:
        """Write it so that a kill leaves the old or the new one."""
        draft = path.with_suffix(".part")
        draft.write_text(json.dumps(self.__dict__))
        draft.replace(path)

    @staticmethod
    def load(path: Path) -> Progress:
        """Read it."""
        data = json.loads(path.read_text())
        return Progress(**{**data, "best": tuple(data["best"])})


class Keeper(BaseCallback):
    """Evaluates, keeps the best and the last policy, and logs, as training goes on."""

    def __init__(
        self,
        config: TrainConfig,
        folder: Path,
        progress: Progress,
        rate: Rate,
        report: Report | None,
    ) -> None:
        super().__init__()
        self.config, self.folder, self.progress = config, folder, progress
        self.rate, self.report = rate, report
        self._every = max(config.total_steps // config.evaluations, 1)
        self._next = (progress.steps // self._every + 1) * self._every
        self._row: dict[str, float] = {}
        self._clock = (time.process_time(), time.perf_counter())

    def _on_step(self) -> bool:
        env = self.training_env
        assert isinstance(env, AirHockeyVecEnv)
        for name, value in env.last_terms.items():
            self.logger.record_mean(f"reward/{name}", value)
        return True

    def _on_rollout_start(self) -> None:
        divergence = self.logger.name_to_value.get("train/approx_kl")
        if divergence is not None:
            self.rate.adapt(float(divergence))
        self._account()
        if self.num_timesteps >= self._next:
            self.checkpoint()
            self._next += self._every
        if self.report is not None:
            self.report(self.num_timesteps, self.config.total_steps, self._row)

    def _account(self) -> None:
        now = (time.process_time(), time.perf_counter())
        self.progress.cpu_seconds += now[0] - self._clock[0]
        self.progress.wall_seconds += now[1] - self._clock[1]
        self._clock = now
        self.progress.steps, self.progress.rate = self.num_timesteps, self.rate.rate

    def checkpoint(self) -> dict[str, float]:
        """Evaluate, keep the policy if it is the best, and save where the run stands.

        The time of evaluations does not count as training.
        """
        self._account()
        mean = evaluate_model(self.model, self.config, True)
        sampled = evaluate_model(self.model, self.config, False)
        values = (
            self.progress.steps,
            self.progress.cpu_seconds,
            self.progress.wall_seconds,
            mean.success,
            sampled.success,
            mean.first_shot,
            mean.returns,
            mean.length,
            mean.hits,
        )
        self._row = dict(zip(COLUMNS, values, strict=True))
        for name in COLUMNS[3:]:
            self.logger.record(f"eval/{name}", self._row[name])
        table = self.folder / "evaluations.csv"
        fresh = not table.exists()
        with table.open("a", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            if fresh:
                writer.writeheader()
            writer.writerow(self._row)
        score = (mean.success, mean.returns)
        if score > tuple(self.progress.best):
            self.progress.best = score
            _save(self.model, self.folder / "best.zip")
        _save(self.model, self.folder / "last.zip")
        self.progress.save(self.folder / "state.json")
        self._clock = (time.process_time(), time.perf_counter())
        return self._row


def _save(model: Any, path: Path) -> None:
    draft = path.with_name(f"part-{path.name}")
    model.save(draft)
    draft.replace(path)


def evaluate_model(model: Any, config: TrainConfig, deterministic: bool) -> Result:
    """Evaluate a model in training on the evaluation seeds."""

    def predict(observation: Any, mean: bool) -> Any:
        return model.predict(observation, deterministic=mean)[0]

    shape = model.observation_space.shape
    policy = Policy(predict, shape, config.observe, "training", deterministic)
    return evaluate(
        policy,
        "training",
        config.scenario,
        config.eval_episodes,
        EVAL_SEED,
        {k: v for k, v in config.keywords.items() if k != "drivers"},  # type: ignore[arg-type]
        config.drivers,
    )


def train(
    config: TrainConfig | None, folder: Path, report: Report | None = None
) -> dict[str, float]:
    """Train, or go on with a run that was cut off.

    Args:
        config: what to do; None to resume the run in the folder.
        folder: of the run; must be new unless it is resumed.
        report: called as training goes on.

    Returns:
        The last row of ``evaluations.csv``.

    Raises:
        ValueError: a folder that holds another run, or no run to resume.
    """
    resumed = config is None
    if config is None:
        config = load_config(folder / "config.toml")
        state = folder / "state.json"
        progress = Progress.load(state) if state.exists() else Progress()
    else:
        if (folder / "config.toml").exists():
            raise ValueError(f"{folder} holds a run already: use --resume, or another")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "config.toml").write_text(config.to_toml())
        (folder / "versions.json").write_text(json.dumps(versions(), indent=1))
        progress = Progress()
    left = config.total_steps - progress.steps
    if left <= 0:
        return _last_row(folder)
    torch.set_num_threads(config.torch_threads)
    torch.set_flush_denormal(True)
    rate = Rate(config, progress.rate or config.learning_rate)
    env = make_sb3_vec(config.scenario, config.num_worlds, **config.keywords)
    if resumed and (folder / "last.zip").exists():
        model = PPO.load(folder / "last.zip", env, device="cpu")
        model.learning_rate = model.lr_schedule = rate
    else:
        model = build(config, env, rate)
    # Other worlds than those before the cut.
    env.seed(config.seed * 10_000 + progress.steps % 9973)
    model.set_logger(_logger(folder, progress.steps))
    keeper = Keeper(config, folder, progress, rate, report)
    model.learn(left, callback=keeper, reset_num_timesteps=progress.steps == 0)
    row = keeper.checkpoint()
    model.logger.dump(progress.steps)
    model.logger.close()
    env.close()
    return row


def _logger(folder: Path, steps: int) -> Logger:
    """CSV and tensorboard; a resumed run begins another CSV, none is overwritten."""
    name = f"progress-{steps}.csv" if steps else "progress.csv"
    table = CSVOutputFormat(str(folder / name))
    return Logger(str(folder), [table, TensorBoardOutputFormat(str(folder))])


def _last_row(folder: Path) -> dict[str, float]:
    with (folder / "evaluations.csv").open() as file:
        *_, last = csv.DictReader(file)
    return {name: float(value) for name, value in last.items()}


def build(config: TrainConfig, env: AirHockeyVecEnv, rate: Rate) -> PPO:
    """A fresh PPO model for an environment."""
    layout = env.world.observer.layout
    policy, extra = "MlpPolicy", {}
    if config.observe == "pixels":
        policy = "CnnPolicy"
    else:
        policy = "MultiInputPolicy" if config.options.get("goals") else policy
        extra = {
            "features_extractor_class": FixedScale,
            "features_extractor_kwargs": {
                "centre": layout.centre.tolist(),
                "unit": layout.unit.tolist(),
            },
        }
    model = PPO(
        policy,
        env,
        learning_rate=rate,
        n_steps=config.n_steps,
        batch_size=config.batch_size,
        n_epochs=config.n_epochs,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip_range,
        ent_coef=config.ent_coef,
        max_grad_norm=config.max_grad_norm,
        seed=config.seed,
        device="cpu",
        policy_kwargs={
            "net_arch": {"pi": config.hidden, "vf": config.hidden},
            "activation_fn": torch.nn.ReLU,
            "log_std_init": config.log_std_init,
            "optimizer_kwargs": {"eps": 1e-5},
            **extra,
        },
    )
    # Saved with the model, so that the file alone says what it wants to see.
    card = {
        "scenario": config.scenario,
        "observe": config.observe,
        "labels": list(layout.labels),
    }
    vars(model)["card"] = card
    return model


def versions() -> dict[str, str]:
    """Versions of all that a result may depend on, and the git hash of a checkout."""
    names = ("marl_airhockey", "numpy", "gymnasium", "pettingzoo", "pymunk", "torch")
    found = {"python": platform.python_version()}
    for name in (*names, "stable_baselines3"):
        found[name] = metadata.version(name)
    here = Path(__file__).parent
    command = ["git", "-C", str(here), "rev-parse", "HEAD"]
    try:
        git = subprocess.run(command, capture_output=True, text=True, check=True)
        found["git"] = git.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        found["git"] = "unknown"
    return found
