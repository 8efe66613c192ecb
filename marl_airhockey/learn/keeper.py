"""What goes on beside the learning: evaluation, checkpoints, logs, learning rate."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stable_baselines3.common.callbacks import BaseCallback

from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.policy import Policy
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
        config.keywords,
    )
