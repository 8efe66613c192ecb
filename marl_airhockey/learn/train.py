"""Training of a policy: by PPO with a choice of engines, by SAC, or from recordings.

A run is a folder: ``config.toml`` (all settings and the run format), ``versions.json``,
progress tables and tensorboard events, ``evaluations.csv``, the best and the last
policy, and ``state.json``, from which an interrupted run is resumed.
"""

from __future__ import annotations

import json
import platform
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from marl_airhockey.learn.algorithms import (
    PPO,
    AnyConfig,
    load_any_config,
    make_config,
)
from marl_airhockey.learn.evaluate_policy import Metrics
from marl_airhockey.learn.hindsight.config import HindsightConfig
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import Config, ProgressCallback, TrainingRun
from marl_airhockey.policies.load import load_policy
from marl_airhockey.policies.trust import trust_code
from marl_airhockey.registry import find_scenario, make_driver
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.image_form import shows_images
from marl_airhockey.sim.core.errors import require, unknown_name


@dataclass(frozen=True)
class TrainingResult:
    """Result of a training run."""

    folder: Path
    """Folder of the run. It can be used as a driver, which is its best policy."""
    steps: int
    """Number of steps, summed over all worlds."""
    metrics: dict[str, float]
    """Last row of ``evaluations.csv`` with "success" or "score", "return" and further
    columns."""

    def policy(self, deterministic: bool = True) -> Driver:
        """Return the best policy as a driver."""
        return load_policy(self.folder, deterministic)


def train(
    scenario: str,
    folder: str | Path | None = None,
    *,
    algo: str = PPO,
    data: str | Path | Sequence[str | Path] = (),
    report: ProgressCallback | None = None,
    **settings: Any,
) -> TrainingResult:
    """Train a policy with PPO and the preset of a scenario, or by another algorithm.

    Args:
        scenario: Name or code of the scenario, see `registry.find_scenario`.
        folder: Folder of the run; None for ``runs/SCENARIO-SEED``.
        algo: Name of the algorithm: "ppo"; "sac_her" for scenarios with goals; "bc",
            "iql", "td3_bc" or "rebrac" for offline RL from recordings.
        data: Recordings, folders of recordings and names of datasets for offline RL,
            one or several.
        report: Function that is called with the finished steps, all steps and the
            latest evaluation.
        **settings: Changed settings of the preset: `total_steps`, `seed`, `profile`,
            `observe`, `options`, `drivers` and others. They are the fields of
            `learn.ppo_config.PPOConfig`, `learn.hindsight.config.HindsightConfig` and
            `learn.offline.config.OfflineConfig`.

    Raises:
        ValueError: A scenario or a setting is unknown, or the folder contains a run.
        RuntimeError: An extra is not installed. The message has the command that
            installs it.
    """
    given = [data] if isinstance(data, str | Path) else data
    config = make_config(algo, scenario, given, settings)
    place = Path(folder) if folder else default_folder(config)
    row = run_training(config, place, report)
    return TrainingResult(place, int(row["steps"]), dict(row))


def default_folder(config: AnyConfig) -> Path:
    """Return the default folder of a run."""
    kind = "" if isinstance(config, PPOConfig) else f"{config.algo}-"
    return Path("runs") / f"{find_scenario(config.scenario).name}-{kind}{config.seed}"


def run_training(
    config: AnyConfig | None,
    folder: Path,
    report: ProgressCallback | None = None,
) -> Metrics:
    """Train a policy in a folder, or resume an interrupted run.

    Args:
        config: Configuration of a new run; None to resume the run in the folder.
        folder: Folder of the run, which must be empty or missing unless the run is
            resumed.
        report: Function that is called with the finished steps, all steps and the
            latest evaluation.

    Returns:
        The last row of ``evaluations.csv``.

    Raises:
        ValueError: The folder contains another run or other files, there is no run to
            resume, or the run has another format.
        RuntimeError: An extra is not installed, and the message has the command that
            installs it; or another process trains in the folder.
    """
    if config is None:
        config = load_any_config(folder)
        with _only_here(folder):
            return _continuation(config, folder, report)()
    if (folder / "config.toml").exists():
        raise ValueError(
            f"{folder} contains a run already: --resume it, or choose another --out"
        )
    if folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} contains other files: choose another --out folder")
    begin = _continuation(config, folder, report)
    folder.mkdir(parents=True, exist_ok=True)
    with _only_here(folder):
        (folder / "config.toml").write_text(config.to_toml())
        for named in (config.scenario, *config.drivers.values()):
            trust_code(named)
        (folder / "versions.json").write_text(json.dumps(versions(), indent=1))
        try:
            return begin()
        except BaseException:
            # A run that fails to start removes the files that it wrote.
            if not (folder / "state.json").exists():
                shutil.rmtree(folder)
            raise


@contextmanager
def _only_here(folder: Path) -> Iterator[None]:
    """Lock a folder, so that no other process trains in it.

    Raises:
        RuntimeError: Another process trains in the folder.
    """
    try:
        with FileLock(folder / ".lock", timeout=0):
            yield
    except Timeout as error:
        raise RuntimeError(f"{folder}: another process trains in it") from error


def _continuation(
    config: AnyConfig, folder: Path, report: ProgressCallback | None
) -> Callable[[], Metrics]:
    """Return a function that trains a run to its end, or resumes it.

    Raises:
        ValueError: An engine or an opponent is unknown.
    """
    if shows_images(config.observe):
        require("onnx", "offline")
    if isinstance(config, OfflineConfig):
        require("torch", "train")
        require("tensorboard", "train")
        if shows_images(config.observe):
            from marl_airhockey.learn.offline.pixels import clone_from_pixels as learn
        else:
            from marl_airhockey.learn.offline.learner import train_offline as learn
        return lambda: _go_on(learn, TrainingRun(config, folder, report))
    if isinstance(config, HindsightConfig):
        require("stable_baselines3", "train")
        require("tensorboard", "train")
        from marl_airhockey.learn.hindsight.sac import train_with_hindsight

        return lambda: _go_on(train_with_hindsight, TrainingRun(config, folder, report))
    if config.engine not in ENGINES:
        raise ValueError(unknown_name("engine", config.engine, ENGINES))
    engine = ENGINES[config.engine]()
    if config.self_play:  # Unknown drivers raise before the training begins.
        for name in {*config.opponents, *config.eval_opponents}:
            make_driver(name)
    return lambda: _go_on(engine, TrainingRun(config, folder, report))


def _go_on(
    engine: Callable[[TrainingRun[Config]], Metrics], run: TrainingRun[Config]
) -> Metrics:
    return engine(run) if run.steps_left > 0 else run.latest


Engine = Callable[[TrainingRun[PPOConfig]], Metrics]
"""Function that trains a run to its end and returns the last evaluation."""


def _sb3() -> Engine:
    require("stable_baselines3", "train")
    require("tensorboard", "train")
    from marl_airhockey.learn.sb3 import train_with_sb3

    return train_with_sb3


def _torch() -> Engine:
    require("torch", "train")
    require("tensorboard", "train")
    from marl_airhockey.learn.ppo import train_with_torch

    return train_with_torch


def _rllib() -> Engine:
    require("ray", "distributed")
    from marl_airhockey.learn.rllib import train_with_rllib

    return train_with_rllib


def _device() -> Engine:
    require("torch", "train")
    require("tensorboard", "train")
    from marl_airhockey.learn.ppo_device import train_on_device

    return train_on_device


ENGINES: dict[str, Callable[[], Engine]] = {
    "torch": _torch,
    "sb3": _sb3,
    "rllib": _rllib,
    "device": _device,
}
"""Loaders of the engines, by name. An engine is imported when it is used."""


def versions() -> dict[str, str]:
    """Return the versions that a result may depend on; a checkout has a git hash."""
    names = ("marl_airhockey", "numpy", "gymnasium", "pettingzoo", "pymunk", "torch")
    found = {"python": platform.python_version()}
    for name in names:
        found[name] = metadata.version(name)
    with suppress(metadata.PackageNotFoundError):
        found["stable_baselines3"] = metadata.version("stable_baselines3")
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        # An installed copy may be inside an unrelated repository.
        tracked = [*git, "ls-files", "--error-unmatch", Path(__file__).name]
        subprocess.run(tracked, capture_output=True, check=True)
        head = [*git, "rev-parse", "HEAD"]
        done = subprocess.run(head, capture_output=True, text=True, check=True)
        found["git"] = done.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        pass  # The version of the package is sufficient.
    return found
