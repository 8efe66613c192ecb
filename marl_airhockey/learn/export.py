"""Export of the policy of a run as one small file with a card.

The card contains the origin of the policy and its measured performance.
"""

from __future__ import annotations

import datetime
import json
import shlex
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from marl_airhockey.data.files import dataset_of, recordings_in
from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.algorithms import (
    PPO,
    AnyConfig,
    load_any_config,
    make_config,
)
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.run import Progress
from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import Policy, policy_driver, trained_in
from marl_airhockey.registry import find_scenario, make_driver
from marl_airhockey.sim.core.errors import require

EPISODES = 1000
"""Number of episodes that measure the policy of a task."""
GAMES = 200
"""Number of games against each opponent that measure the policy of a game."""


def export_policy(run: Path, out: Path, checkpoint: Path | None = None) -> NumpyPolicy:
    """Write a policy of a run, measured on seeds that training never uses.

    Args:
        run: Folder of a run of `train`.
        out: Path of the file, which ends in .npz or .onnx.
        checkpoint: Path of one of the ``checkpoints`` of the run; None for the last
            policy.

    Raises:
        ValueError: The folder has no policy, the run has another format, the policy has
            no NumPy form, or ``out`` has another extension.
        RuntimeError: onnx is not installed. The message has the command that installs
            it.
    """
    if out.suffix not in (".npz", ".onnx"):
        raise ValueError(f"out: {out} must end in .npz or .onnx")
    if out.suffix == ".onnx":
        require("onnx", "offline")
    config = load_any_config(run)
    if not (run / "state.json").exists():
        raise ValueError(f"{run}: the run has no policy yet; train it first")
    progress = Progress.load(run / "state.json")
    last = NumpyPolicy.load(checkpoint) if checkpoint else _load_last(run)
    steps = last.card["steps"] if checkpoint else progress.steps
    minutes = progress.cpu_seconds / 60 * steps / progress.steps
    policy = policy_driver(last, str(checkpoint or run))
    if isinstance(config, PPOConfig) and config.self_play:
        metrics = _games(policy, config)
    else:
        metrics = _episodes(policy, config)
    card = {
        **last.card,
        "version": find_scenario(config.scenario).version,
        **trained_in(vars(config)),
        "command": training_command(config),
        "seed": config.seed,
        "steps": steps,
        "cpu_minutes": round(minutes, 2),
        "date": datetime.date.today().isoformat(),
        "grades": metrics,
    }
    frozen = NumpyPolicy(last.layers, last.centre, last.unit, last.log_std, card=card)
    out.parent.mkdir(parents=True, exist_ok=True)
    if out.suffix == ".onnx":
        from marl_airhockey.learn.onnx_export import save_onnx

        save_onnx(frozen, out)
    else:
        frozen.save(out)
    return frozen


def _load_last(run: Path) -> NumpyPolicy:
    """Return the last policy of a run."""
    if not (run / "last.npz").exists():
        raise ValueError(
            f"{run}: a policy of pixels is not exported; use {run / 'last.onnx'}"
        )
    return NumpyPolicy.load(run / "last.npz")


def _episodes(policy: Policy, config: RunConfig) -> dict[str, Any]:
    result = evaluate(
        policy,
        config.scenario,
        episodes=EPISODES,
        seed=TEST_SEED,
        name="frozen",
        exact=True,
        **config.keywords,
    )
    low, high = result.success_interval
    return {"success": result.success, "low": low, "high": high, "episodes": EPISODES}


def _games(policy: Policy, config: PPOConfig) -> dict[str, Any]:
    score, _ = play_against(
        config.scenario,
        policy,
        [make_driver(opponent) for opponent in config.eval_opponents],
        GAMES,
        TEST_SEED,
        {**config.keywords, "drivers": {}},
    )
    return {
        "games_of_each": GAMES,
        "score": {
            opponent: [share, *interval(share, GAMES)]
            for opponent, share in zip(
                config.eval_opponents, score.tolist(), strict=True
            )
        },
    }


def training_command(config: AnyConfig) -> str:
    """Return the command line that trains a configuration again.

    If all recordings of a named dataset are used, they are given by the name of the
    dataset. Other recordings are given relative to the working directory, or only by
    the name of their folder if they are elsewhere.
    """
    algo = PPO if isinstance(config, PPOConfig) else config.algo
    data = config.data if isinstance(config, OfflineConfig) else []
    usual = {"profile": config.profile, "seed": config.seed}
    defaults = make_config(algo, config.scenario, data, usual)
    words = [f"airhockey train {config.scenario} --seed {config.seed}"]
    if algo != PPO:
        words.append(f"--algo {algo}")
    words += [f"--data {shlex.quote(name)}" for name in _given(data)]
    if config.profile != "ideal":
        words.append(f"--profile {config.profile}")
    words += [f"--option {k}={v}" for k, v in config.options.items()]
    words += [f"--driver {k}={v}" for k, v in config.drivers.items()]
    named = {"scenario", "profile", "options", "drivers", "seed", "algo", "data"}
    if isinstance(config, PPOConfig) and not config.self_play:
        named |= {*config.SELF_PLAY}
    for f in fields(config):
        value = getattr(config, f.name)
        if f.name not in named and value != getattr(defaults, f.name):
            setting = f"{f.name}={json.dumps(value, separators=(',', ':'))}"
            words.append("--set " + shlex.quote(setting))
    return " ".join(words)


def _given(data: Sequence[str]) -> list[str]:
    """Return the names by which recordings are given on a command line."""
    found: list[str] = []
    for path in map(Path, data):
        name = dataset_of(path)
        if name and {str(p) for p in recordings_in([Path(name)])} <= {*data}:
            found.append(name)
        elif path.is_relative_to(Path.cwd()):
            found.append(str(path.relative_to(Path.cwd())))
        else:
            found.append(path.name)
    return list(dict.fromkeys(found))
