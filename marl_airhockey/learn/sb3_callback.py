"""What goes on beside the learning of stable-baselines3: rate, logs, checkpoints."""

from __future__ import annotations

from functools import partial
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.grade import Grades, judge
from marl_airhockey.learn.network import freeze
from marl_airhockey.learn.run import Ledger
from marl_airhockey.learn.self_play import Arena
from marl_airhockey.toolkit.numpy_policy import Frozen
from marl_airhockey.toolkit.policies import Policy


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


class Keeper(BaseCallback):
    """Has the policy judged and kept, and logs, as training goes on."""

    def __init__(self, ledger: Ledger, rate: Rate) -> None:
        super().__init__()
        self.ledger, self.rate = ledger, rate
        # The first one at once: there must be somebody to play against.
        self._due = ledger.progress.steps

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
        if self.ledger.due:
            self.checkpoint()
        env, config = self.training_env, self.ledger.config
        if isinstance(env, Arena) and self.num_timesteps >= self._due:
            env.snapshot(self._freeze(), self.num_timesteps)
            self._due += config.total_steps // config.snapshots

    def _account(self) -> None:
        self.ledger.account(self.num_timesteps, self.rate.rate)

    def checkpoint(self) -> Grades:
        """Evaluate, and keep the policy if it is the best."""
        self._account()
        ledger, model = self.ledger, self.model
        predict = partial(_predict, model)
        shape = model.observation_space.shape
        grades = judge(
            lambda mean: Policy(
                predict, shape, ledger.config.observe, "training", mean
            ),
            ledger.config,
        )
        for name, value in grades.items():
            self.logger.record(f"eval/{name}", value)
        row = ledger.record(grades, self._save)
        if ledger.config.self_play:
            self._freeze().save(ledger.milestone)
        return row

    def _save(self, name: str) -> None:
        draft = self.ledger.folder / f"part-{name}.zip"
        self.model.save(draft)
        draft.replace(self.ledger.folder / f"{name}.zip")


def _predict(model: Any, observation: Any, deterministic: bool) -> Any:
    return model.predict(observation, deterministic=deterministic)[0]
