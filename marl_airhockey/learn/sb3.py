"""The engine "sb3": PPO of stable-baselines3 over B worlds in one process."""

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
from marl_airhockey.learn.config import TrainConfig
from marl_airhockey.learn.grade import Grades
from marl_airhockey.learn.network import FixedScale, card
from marl_airhockey.learn.run import Ledger
from marl_airhockey.learn.sb3_callback import Keeper, Rate
from marl_airhockey.learn.self_play import environment


def learn(ledger: Ledger) -> Grades:
    """Train to the end of a run, from where it stands."""
    config, folder, progress = ledger.config, ledger.folder, ledger.progress
    torch.set_num_threads(config.torch_threads)
    torch.set_flush_denormal(True)
    rate = Rate(config, progress.rate or config.learning_rate)
    env = environment(config, config.num_worlds, folder / "pool")
    if progress.steps:
        model = PPO.load(folder / "last.zip", env, device="cpu")
        model.learning_rate = model.lr_schedule = rate
    else:
        model = build(config, env, rate)
        if config.init:
            _take_weights(model, Path(config.init))
    # Other worlds than those before the cut.
    env.seed(config.seed * 10_000 + progress.steps % 9973)
    model.set_logger(_logger(folder, progress.steps))
    keeper = Keeper(ledger, rate)
    fresh = progress.steps == 0
    model.learn(ledger.left, callback=keeper, reset_num_timesteps=fresh)
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


def _take_weights(model: PPO, run: Path) -> None:
    """Begin with the weights of a run, its exploration among them.

    Raises:
        ValueError: no run, or one of another size.
    """
    kept = [run / f"{name}.zip" for name in ("best", "last")]
    path = next((file for file in kept if file.exists()), None)
    if path is None:
        raise ValueError(f"init: {run} is no folder of a run of sb3")
    weights = PPO.load(path, device="cpu").policy.state_dict()
    try:
        model.policy.load_state_dict(weights)
    except RuntimeError as error:
        raise ValueError(f"init: {run} has another size: {error}") from error


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
    vars(model)["card"] = card(config, env)
    return model
