"""Callback of stable-baselines3: logs, evaluations, checkpoints."""

from __future__ import annotations

from functools import partial
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.engine import AdaptiveRate, note_step
from marl_airhockey.learn.grade import Metrics, grade
from marl_airhockey.learn.network import to_numpy
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.self_play import SelfPlayVecEnv
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import Policy


class TrainingCallback(BaseCallback):
    """Callback that logs, evaluates and saves the policy during training.

    Args:
        run: run whose folder is kept up to date.
        rate: learning rate of the model.
    """

    def __init__(self, run: TrainingRun[TrainConfig], rate: AdaptiveRate) -> None:
        super().__init__()
        self.run, self.rate = run, rate
        # The first snapshot is due at once: self-play needs an opponent.
        self._snapshot_due = run.progress.steps

    def _to_numpy(self) -> NumpyPolicy:
        """Return the policy as it is."""
        assert isinstance(self.model, PPO)
        return to_numpy(self.model, self.card)

    @property
    def card(self) -> dict[str, Any]:
        """Description of the policy, saved with it."""
        return {**vars(self.model)["card"], "steps": self.num_timesteps}

    def _on_step(self) -> bool:
        env = self.training_env
        assert isinstance(env, AirHockeyVecEnv)
        note_step(self.logger, env)
        return True

    def _on_rollout_start(self) -> None:
        divergence = self.logger.name_to_value.get("train/approx_kl")
        if divergence is not None:
            self.rate.adapt(float(divergence))
        self._update_progress()
        if self.run.evaluation_due:
            self.evaluate()
        env, config = self.training_env, self.run.config
        if isinstance(env, SelfPlayVecEnv) and self.num_timesteps >= self._snapshot_due:
            env.snapshot(self._to_numpy(), self.num_timesteps)
            self._snapshot_due += config.total_steps // config.snapshots

    def _update_progress(self) -> None:
        self.run.update_progress(self.num_timesteps, self.rate.rate)

    def evaluate(self) -> Metrics:
        """Evaluate and save the policy; return the evaluation's row."""
        self._update_progress()
        run, model = self.run, self.model
        predict = partial(_predict, model)
        shape = model.observation_space.shape
        metrics = grade(
            lambda mean: Policy(predict, shape, run.config.observe, "training", mean),
            run.config,
        )
        for name, value in metrics.items():
            self.logger.record(f"eval/{name}", value)
        row = run.record_evaluation(metrics, self._save)
        if run.config.self_play:
            self._to_numpy().save(run.checkpoint_path)
        return row

    def _save(self, name: str) -> None:
        draft = self.run.folder / f"part-{name}.zip"
        self.model.save(draft)
        draft.replace(self.run.folder / f"{name}.zip")
        if self.run.config.observe != "pixels":
            self._to_numpy().save(self.run.folder / f"{name}.npz")


def _predict(model: Any, observation: Any, deterministic: bool) -> Any:
    return model.predict(observation, deterministic=deterministic)[0]
