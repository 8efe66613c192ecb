"""Engine "sb3": PPO of stable-baselines3 over B worlds in one process."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.utils import ConstantSchedule

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.device import torch_device
from marl_airhockey.learn.engine import (
    AdaptiveRate,
    end_setup,
    evaluate_and_record,
    initial_weights,
    note_step,
    other_size,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.logs import RunLog
from marl_airhockey.learn.network import FixedScale, ImageFeatures
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.self_play import SelfPlayEnv, make_training_env
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import Policy
from marl_airhockey.policies.sb3 import load_weights, numpy_actor
from marl_airhockey.sim.contracts.image_form import image_form, shows_images

NEVER = 10**9
"""Number of rollouts between two rows that a model writes automatically. It is large,
because the run writes the rows."""


def train_with_sb3(run: TrainingRun[PPOConfig]) -> Metrics:
    """Train a run to its end, or resume it; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return SB3Trainer(run).train()


class SB3Trainer:
    """PPO trainer of a run, which makes one rollout per call.

    Args:
        run: Run whose folder is updated.
    """

    def __init__(self, run: TrainingRun[PPOConfig]) -> None:
        config, folder, steps = run.config, run.folder, run.progress.steps
        self._run = run
        self._slots = make_training_env(config, config.num_worlds, folder / "pool")
        self._rate = AdaptiveRate(config, run.progress.rate or config.learning_rate)
        self._env = AirHockeyVecEnv(self._slots)
        if steps:
            self._model = PPO.load(
                folder / "last.zip", self._env, device=torch_device(config.device)
            )
        else:
            self._model = build_model(config, self._env)
            if config.init:
                _take_weights(self._model, initial_weights(config))
        # A resumed run must not repeat the episodes of its beginning.
        self._env.seed(config.seed * 10_000 + steps % 9973)
        self._model.set_logger(make_logger(folder, steps))
        # The first snapshot is due immediately, because self-play needs an opponent.
        self._snapshot_due = steps
        end_setup(run)

    def train(self) -> Metrics:
        """Train to the end of the run; return the last evaluation."""
        row = self._run.train(self._advance, self._evaluate, self._model.logger)
        self._env.close()
        return row

    def _advance(self) -> tuple[int, float]:
        """Play a rollout and learn from it; return the steps so far and the rate."""
        model, config, slots = self._model, self._run.config, self._slots
        steps = model.num_timesteps
        if isinstance(slots, SelfPlayEnv) and steps >= self._snapshot_due:
            slots.snapshot(self._to_numpy(), steps)
            self._snapshot_due += config.total_steps // config.snapshots
        left = max(1.0 - (steps + config.rollout) / config.total_steps, 0.0)
        model.lr_schedule = ConstantSchedule(self._rate(left))
        learn_for(model, config.rollout, slots)
        self._rate.adapt(model.logger.name_to_value["train/approx_kl"])
        return model.num_timesteps, self._rate.rate

    def _to_numpy(self) -> NumpyPolicy:
        """Return the current policy."""
        card = {**vars(self._model)["card"], "steps": self._model.num_timesteps}
        return numpy_actor(self._model.policy.state_dict(), card)

    def _evaluate(self) -> Metrics:
        """Evaluate and save the policy; return the row of the evaluation."""
        run, model = self._run, self._model
        observe, shape = run.config.observe, model.observation_space.shape
        if shows_images(observe):  # The model's own space has the channels first.
            shape = image_form(observe).shape
        make = partial(Policy, partial(_predict, model), shape, observe, "training")
        row = evaluate_and_record(run, make, model.logger, self._save)
        if run.config.self_play:
            self._to_numpy().save(run.checkpoint_path)
        return row

    def _save(self, name: str) -> None:
        folder = self._run.folder
        draft = folder / f"part-{name}.zip"
        self._model.save(draft)
        draft.replace(folder / f"{name}.zip")
        if not shows_images(self._run.config.observe):
            self._to_numpy().save(folder / f"{name}.npz")
            return
        from marl_airhockey.learn.image_export import save_image_policy

        network: Any = self._model.policy
        card = vars(self._model)["card"]
        seen, hidden = network.features_extractor, network.mlp_extractor.policy_net
        head = torch.nn.Sequential(hidden, network.action_net)
        shape = image_form(self._run.config.observe).shape
        card = {**card, "steps": self._model.num_timesteps}
        save_image_policy(seen.layers, head, shape, card, folder / f"{name}.onnx")


def learn_for(model: BaseAlgorithm, steps: int, slots: SlotEnv) -> None:
    """Let a model learn for a number of steps, and log each of them."""

    def note(_locals: dict[str, Any], _globals: dict[str, Any]) -> bool:
        note_step(model.logger, slots)
        return True

    model.learn(steps, note, log_interval=NEVER, reset_num_timesteps=False)


def _predict(model: PPO, observation: Any, deterministic: bool) -> Any:
    return model.predict(observation, deterministic=deterministic)[0]


def _take_weights(model: PPO, path: Path) -> None:
    """Load weights from a file into a model, including its exploration.

    Raises:
        ValueError: The weights have another size.
    """
    try:
        model.policy.load_state_dict(load_weights(path))
    except RuntimeError as error:
        raise other_size(path, error) from error


class _Rows(KVWriter):
    """Output of a logger of stable-baselines3 into a `RunLog`."""

    def __init__(self, log: RunLog) -> None:
        self._log = log

    def write(
        self, values: dict[str, Any], excluded: dict[str, Any], step: int = 0
    ) -> None:
        for key, value in values.items():
            self._log.record(key, value)
        self._log.dump(step)

    def close(self) -> None:
        self._log.close()


def make_logger(folder: Path, steps: int) -> Logger:
    """Return a logger that writes the files of `logs.RunLog`."""
    return Logger(str(folder), [_Rows(RunLog(folder, steps))])


def build_model(config: PPOConfig, env: AirHockeyVecEnv) -> PPO:
    """Build a new PPO model for an environment, with its card as ``model.card``."""
    layout = env.world.observer.layout
    policy, extra = "MlpPolicy", dict[str, Any]()
    if shows_images(config.observe):
        policy = "CnnPolicy"
        extra = {"features_extractor_class": ImageFeatures}
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
        learning_rate=config.learning_rate,
        n_steps=config.n_steps,
        batch_size=config.batch_size,
        n_epochs=config.n_epochs,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip_range,
        ent_coef=config.ent_coef,
        max_grad_norm=config.max_grad_norm,
        seed=config.seed,
        device=torch_device(config.device),
        policy_kwargs={
            "net_arch": {"pi": config.hidden, "vf": config.hidden},
            "activation_fn": torch.nn.ReLU,
            "log_std_init": config.log_std_init,
            "optimizer_kwargs": {"eps": 1e-5},
            **extra,
        },
    )
    # SB3 saves the card with the model, so the file describes the observations.
    vars(model)["card"] = config.card(layout.labels)
    return model
