"""What goes on beside the learning: evaluation, checkpoints, logs, learning rate."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from marl_airhockey.frozen import Frozen
from marl_airhockey.learn.arena import Arena
from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.judge import judge
from marl_airhockey.learn.network import freeze
from marl_airhockey.vector_sb3 import AirHockeyVecEnv

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
        # The first one at once: there must be somebody to play against.
        self._due = progress.steps
        self._row: dict[str, float] = {}
        self._clock = (time.process_time(), time.perf_counter())

    def _freeze(self) -> Frozen:
        """The policy as it is."""
        assert isinstance(self.model, PPO)
        return freeze(self.model, self.card)

    @property
    def card(self) -> dict[str, Any]:
        """What the policy is, as saved with it."""
        return {**vars(self.model)["card"], "steps": self.num_timesteps}

    def _on_step(self) -> bool:
        env = self.training_env
        assert isinstance(env, AirHockeyVecEnv)
        for name, value in env.last_terms.items():
            self.logger.record_mean(f"reward/{name}", value)
        if isinstance(env, Arena):
            for name, value in env.scores.items():
                self.logger.record(f"score/{name}", value)
        return True

    def _on_rollout_start(self) -> None:
        divergence = self.logger.name_to_value.get("train/approx_kl")
        if divergence is not None:
            self.rate.adapt(float(divergence))
        self._account()
        if self.num_timesteps >= self._next:
            self.checkpoint()
            self._next += self._every
        env = self.training_env
        if isinstance(env, Arena) and self.num_timesteps >= self._due:
            env.snapshot(self._freeze(), self.num_timesteps)
            self._due += self.config.total_steps // self.config.snapshots
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
        grades = judge(self.model, self.config)
        progress = self.progress
        clock = {
            "steps": progress.steps,
            "cpu_seconds": progress.cpu_seconds,
            "wall_seconds": progress.wall_seconds,
        }
        self._row = {**clock, **grades}
        for name, value in grades.items():
            self.logger.record(f"eval/{name}", value)
        table = self.folder / "evaluations.csv"
        fresh = not table.exists()
        with table.open("a", newline="") as file:
            writer = csv.DictWriter(file, list(self._row))
            if fresh:
                writer.writeheader()
            writer.writerow(self._row)
        score = (next(iter(grades.values())), grades["return"])
        if score > tuple(progress.best):
            progress.best = score
            _save(self.model, self.folder / "best.zip")
        _save(self.model, self.folder / "last.zip")
        if self.config.self_play:
            past = self.folder / "milestones"
            past.mkdir(exist_ok=True)
            name = f"{progress.steps:012d}.npz"
            self._freeze().save(past / name)
        self.progress.save(self.folder / "state.json")
        self._clock = (time.process_time(), time.perf_counter())
        return self._row


def _save(model: Any, path: Path) -> None:
    draft = path.with_name(f"part-{path.name}")
    model.save(draft)
    draft.replace(path)
