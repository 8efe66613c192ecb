"""Callback of stable-baselines3: logs, evaluations, checkpoints."""

from __future__ import annotations

from functools import partial
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.engine import AdaptiveRate, note_step
from marl_airhockey.learn.evaluate_policy import Metrics, evaluate_policy
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.self_play import SelfPlayEnv
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import Policy
from marl_airhockey.policies.sb3 import numpy_actor


class TrainingCallback(BaseCallback):
    """Callback that logs, evaluates and saves the policy during training.

    Args:
        run: run whose folder is kept up to date.
        rate: learning rate of the model.
    """

    def __init__(self, run: TrainingRun[PPOConfig], rate: AdaptiveRate) -> None:
        super().__init__()
        self.run, self.rate = run, rate
        # The first snapshot is due at once: self-play needs an opponent.
        self._snapshot_due = run.progress.steps

    def _to_numpy(self) -> NumpyPolicy:
        """Return the policy as it is."""
        assert isinstance(self.model, PPO)
        return numpy_actor(self.model.policy.state_dict(), self.card)

    @property
    def card(self) -> dict[str, Any]:
        """Description of the policy, saved with it."""
        return {**vars(self.model)["card"], "steps": self.num_timesteps}

    def _on_step(self) -> bool:
        note_step(self.logger, self._slots)
        return True

    @property
    def _slots(self) -> SlotEnv:
        assert isinstance(self.training_env, AirHockeyVecEnv)
        return self.training_env.slots

    def _on_rollout_start(self) -> None:
        divergence = self.logger.name_to_value.get("train/approx_kl")
        if divergence is not None:
            self.rate.adapt(float(divergence))
        self._update_progress()
        if self.run.evaluation_due:
            self.evaluate()
        env, config = self._slots, self.run.config
        if isinstance(env, SelfPlayEnv) and self.num_timesteps >= self._snapshot_due:
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
        metrics = evaluate_policy(
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
