"""Engine "sb3": PPO of stable-baselines3 over B worlds in one process."""

from __future__ import annotations

from pathlib import Path

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import (
    CSVOutputFormat,
    Logger,
    TensorBoardOutputFormat,
)

from marl_airhockey.envs.sb3_vec_env import AirHockeyVecEnv
from marl_airhockey.learn.engine import (
    AdaptiveRate,
    end_setup,
    other_size,
    training_threads,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.logs import progress_path
from marl_airhockey.learn.network import FixedScale
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.sb3_callback import TrainingCallback
from marl_airhockey.learn.self_play import make_training_env
from marl_airhockey.learn.settings import load_config
from marl_airhockey.policies.sb3 import load_weights


def train_with_sb3(run: TrainingRun[PPOConfig]) -> Metrics:
    """Train a run from where it stands to its end; return the last evaluation."""
    with training_threads(run.config.torch_threads):
        return _train(run)


def _train(run: TrainingRun[PPOConfig]) -> Metrics:
    config, folder, progress = run.config, run.folder, run.progress
    rate = AdaptiveRate(config, progress.rate or config.learning_rate)
    env = AirHockeyVecEnv(make_training_env(config, config.num_worlds, folder / "pool"))
    if progress.steps:
        model = PPO.load(folder / "last.zip", env, device="cpu")
        model.learning_rate = model.lr_schedule = rate
    else:
        model = build_model(config, env, rate)
        if config.init:
            _take_weights(model, Path(config.init))
    # A resumed run must not repeat the episodes of its beginning.
    env.seed(config.seed * 10_000 + progress.steps % 9973)
    model.set_logger(make_logger(folder, progress.steps))
    callback = TrainingCallback(run, rate)
    end_setup(run)
    fresh = progress.steps == 0
    try:
        model.learn(run.steps_left, callback=callback, reset_num_timesteps=fresh)
        row = callback.evaluate()
        model.logger.dump(progress.steps)
    finally:
        model.logger.close()
        env.close()
    return row


def _take_weights(model: PPO, run: Path) -> None:
    """Load the weights of a run into a model, its exploration among them.

    Raises:
        ValueError: no run, one of another format, or one of another size.
    """
    kept = [run / f"{name}.zip" for name in ("best", "last")]
    path = next((file for file in kept if file.exists()), None)
    if path is None:
        raise ValueError(f"init: {run} is no folder of a run of the engine sb3")
    if (run / "config.toml").exists():
        load_config(PPOConfig, run / "config.toml")
    weights = load_weights(path)
    try:
        model.policy.load_state_dict(weights)
    except RuntimeError as error:
        raise other_size(path, error) from error


def make_logger(folder: Path, steps: int) -> Logger:
    """Return a logger to the files of `logs.RunLog`."""
    table = CSVOutputFormat(str(progress_path(folder, steps)))
    return Logger(str(folder), [table, TensorBoardOutputFormat(str(folder))])


def build_model(config: PPOConfig, env: AirHockeyVecEnv, rate: AdaptiveRate) -> PPO:
    """Build a fresh PPO model for an environment, with its card as ``model.card``."""
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
    # SB3 saves it with the model: the file alone says what the policy must see.
    vars(model)["card"] = config.card(layout.labels)
    return model
