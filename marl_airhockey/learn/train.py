"""Train a policy with PPO.

A run is a folder: ``config.toml`` (resolved), ``versions.json``, progress tables and
tensorboard events, ``evaluations.csv``, the best and the last policy, and
``state.json`` from which a killed run goes on.
"""

from __future__ import annotations

import json
import platform
import subprocess
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from marl_airhockey.core.errors import require, unknown_name
from marl_airhockey.learn.config import TrainConfig, load_config
from marl_airhockey.learn.grade import Grades
from marl_airhockey.learn.run import Ledger, Report


def train(
    config: TrainConfig | None, folder: Path, report: Report | None = None
) -> Grades:
    """Train, or go on with a run that was cut off.

    Args:
        config: what to do; None to resume the run in the folder.
        folder: of the run; must be new unless it is resumed.
        report: called as training goes on.

    Returns:
        The last row of ``evaluations.csv``.

    Raises:
        ValueError: a folder that holds another run, or no run to resume.
        RuntimeError: a missing extra, with the line that installs it.
    """
    if config is None:
        config = load_config(folder / "config.toml")
    elif (folder / "config.toml").exists():
        raise ValueError(f"{folder} holds a run already: use --resume, or another")
    if config.engine not in ENGINES:
        raise ValueError(unknown_name("engine", config.engine, ENGINES))
    learn = ENGINES[config.engine]()
    if not (folder / "config.toml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "config.toml").write_text(config.to_toml())
        (folder / "versions.json").write_text(json.dumps(versions(), indent=1))
    ledger = Ledger(config, folder, report)
    return learn(ledger) if ledger.left > 0 else ledger.row


Learn = Callable[[Ledger], Grades]


def _sb3() -> Learn:
    require("stable_baselines3", "train")
    from marl_airhockey.learn.sb3 import learn

    return learn


def _rllib() -> Learn:
    require("ray", "distributed")
    from marl_airhockey.learn.rllib import learn

    return learn


ENGINES: dict[str, Callable[[], Learn]] = {"sb3": _sb3, "rllib": _rllib}
"""How policies are trained, by name; each is imported when it is asked for."""


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
