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
from importlib import metadata
from pathlib import Path

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import (
    CSVOutputFormat,
    Logger,
    TensorBoardOutputFormat,
)

from marl_airhockey.learn.arena import Arena
from marl_airhockey.learn.config import TrainConfig, load_config
from marl_airhockey.learn.keeper import Keeper, Progress, Rate, Report
from marl_airhockey.learn.network import FixedScale
from marl_airhockey.make import make_sb3_vec
from marl_airhockey.vector_sb3 import AirHockeyVecEnv


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
    env = environment(config, folder)
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


def environment(config: TrainConfig, folder: Path) -> AirHockeyVecEnv:
    """The worlds that a configuration is trained in."""
    if not config.self_play:
        return make_sb3_vec(config.scenario, config.num_worlds, **config.keywords)
    return Arena(
        config.scenario,
        config.num_worlds,
        config.keywords,
        config.opponents,
        config.mirror,
        config.script_share,
        config.priority,
        config.pool,
        folder / "pool",
        config.seed,
    )


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
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        # An installed copy may lie inside a repository of somebody else's.
        tracked = [*git, "ls-files", "--error-unmatch", Path(__file__).name]
        subprocess.run(tracked, capture_output=True, check=True)
        head = [*git, "rev-parse", "HEAD"]
        done = subprocess.run(head, capture_output=True, text=True, check=True)
        found["git"] = done.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        found["git"] = "unknown"
    return found
