"""Code that the engines in one process share: learning rate, logs and threads."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import numpy as np
import torch

from marl_airhockey.build import compile_world
from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.learn.evaluate_policy import (
    DriverFactory,
    Metrics,
    evaluate_policy,
)
from marl_airhockey.learn.logs import Log
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.learn.self_play import SelfPlayEnv
from marl_airhockey.learn.settings import load_config
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.registry import find_backend


class AdaptiveRate:
    """Learning rate that follows the KL divergence of updates and falls to a tenth.

    If the divergence is above twice its target, the rate is divided by 1.5. If it is
    below half of the target, the rate is multiplied by 1.5. Schulman et al. (2017)
    adapt their penalty in the same manner.

    Args:
        config: Configuration of the run, with the target and the bounds of the rate.
        rate: Initial rate.
    """

    def __init__(self, config: PPOConfig, rate: float) -> None:
        self.rate, self._config = rate, config

    def __call__(self, remaining: float) -> float:
        """Return the rate for a share ``remaining`` (1 to 0) of the training."""
        return self.rate * (0.1 + 0.9 * remaining)

    def adapt(self, divergence: float) -> None:
        """Adapt the rate to the divergence of the last update."""
        config = self._config
        if divergence > 2 * config.target_kl:
            self.rate = max(self.rate / 1.5, 0.03 * config.learning_rate)
        elif divergence < config.target_kl / 2:
            self.rate = min(self.rate * 1.5, config.max_learning_rate)


@contextmanager
def training_threads(count: int) -> Iterator[None]:
    """Set the number of torch's threads, and disable subnormal numbers, which are slow.

    Subnormal numbers are disabled for the whole process. They are enabled again at the
    end, because other code relies on them.
    """
    torch.set_num_threads(count)
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


def end_setup(run: TrainingRun[PPOConfig]) -> None:
    """Compile the code that resets worlds, and count the time so far as setup.

    Worlds of an arm are slow to build and compile almost no code, so they are skipped.
    """
    if find_backend(run.config.backend).tracks_commands:
        compile_world(run.config.scenario, run.config.training_keywords)
    run.end_setup()


SUFFIXES = {"torch": ".pt", "sb3": ".zip"}
"""File extensions of the weights, by engine."""


def initial_weights(config: PPOConfig) -> Path:
    """Return the file of the weights that a run begins with, preferably the best ones.

    Raises:
        ValueError: `init` is not a run of the same engine, or has another format.
    """
    run, engine = Path(config.init), config.engine
    if (run / "config.toml").exists():
        load_config(PPOConfig, run / "config.toml")
    files = [run / f"{name}{SUFFIXES[engine]}" for name in ("best", "last")]
    path = next((file for file in files if file.exists()), None)
    if path is None:
        raise ValueError(
            f"init: {run} is not the folder of a run of the engine {engine}"
        )
    return path


def other_size(path: Path, error: RuntimeError) -> ValueError:
    """Return the error for weights that do not fit the network of a run."""
    return ValueError(
        f"{path}: its network has another size; it was trained with another scenario, "
        f"profile or --hidden ({str(error).splitlines()[-1].strip()})"
    )


def note_step(log: Log, env: SlotEnv) -> None:
    """Log the reward terms of the last step, and scores against opponents.

    Raises:
        ValueError: A reward term is nan. The message names it.
    """
    if bad := [name for name, value in env.last_terms.items() if np.isnan(value)]:
        raise ValueError(f"{env.world.scenario.name}: reward terms {bad} are nan")
    for name, value in env.last_terms.items():
        log.record_mean(f"reward/{name}", value)
    if isinstance(env, SelfPlayEnv):
        for name, value in env.scores.items():
            log.record(f"score/{name}", value)


def evaluate_and_record(
    run: TrainingRun[RunConfig],
    make: DriverFactory,
    log: Log,
    save: Callable[[str], None],
) -> Metrics:
    """Evaluate and save a policy in training; return the row of the evaluation.

    Args:
        run: Run whose folder is updated.
        make: Function that returns the current policy as a driver.
        log: Log of the run.
        save: Function that saves the policy under a name, "best" or "last".
    """
    metrics = evaluate_policy(make, run.config)
    for name, value in metrics.items():
        log.record(f"eval/{name}", value)
    return run.record_evaluation(metrics, save)


def save_weights(
    folder: Path,
    name: str,
    model: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    policy: NumpyPolicy,
) -> None:
    """Save a policy and its weights, and under "last" the optimizer in addition.

    Args:
        folder: Folder of the run.
        name: Name of the files, "best" or "last".
        model: Model whose weights are saved.
        optimizer: Optimizer of the model.
        policy: Current policy of the model.
    """
    save_state(folder, name, model, optimizer)
    policy.save(folder / f"{name}.npz")


def save_state(
    folder: Path, name: str, model: torch.nn.Module, optimizer: torch.optim.Optimizer
) -> None:
    """Save weights under a name, and under "last" the optimizer in addition."""
    draft = folder / f"part-{name}.pt"
    state: dict[str, Any] = {"model": model.state_dict()}
    if name == "last":
        state["optimizer"] = optimizer.state_dict()
    torch.save(state, draft)
    draft.replace(folder / f"{name}.pt")


def load_state(path: Path) -> dict[str, Any]:
    """Read a file that `save_state` wrote, without running code in it.

    Raises:
        ValueError: The file is missing or damaged. The message names it.
    """
    try:
        found: dict[str, Any] = torch.load(path, "cpu", weights_only=True)
    except (OSError, EOFError, RuntimeError, UnpicklingError) as error:
        raise ValueError(
            f"{path}: missing or damaged ({error}); begin the run again in another "
            "folder, or copy the file from a backup"
        ) from error
    return found
