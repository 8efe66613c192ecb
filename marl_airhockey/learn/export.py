"""From a run to one small file with a card: how it came about and how good it is."""

from __future__ import annotations

import datetime
import json
import shlex
from dataclasses import fields
from pathlib import Path
from typing import Any

from stable_baselines3 import PPO

from marl_airhockey.evaluation.evaluate import TEST_SEED, evaluate
from marl_airhockey.evaluation.games import challenge
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.config import TrainConfig, load_config, preset
from marl_airhockey.learn.network import freeze
from marl_airhockey.learn.run import Progress
from marl_airhockey.registry import make_agent, make_scenario
from marl_airhockey.toolkit.numpy_policy import Frozen
from marl_airhockey.toolkit.policies import Policy, frozen_policy

EPISODES = 1000
GAMES = 200


def export(run: Path, out: Path) -> Frozen:
    """Freeze the last policy of a run and measure it on seeds that it has not seen.

    Args:
        run: folder of `train`.
        out: the .npz to write.

    Raises:
        ValueError: no run, or a policy that cannot be frozen.
    """
    config = load_config(run / "config.toml")
    if not (run / "state.json").exists():
        raise ValueError(f"{run}: there is no policy in it yet; train it first")
    progress, bare = Progress.load(run / "state.json"), _last(run)
    policy = frozen_policy(bare, str(run))
    grades = _games(policy, config) if config.self_play else _episodes(policy, config)
    card = {
        **bare.card,
        "version": make_scenario(config.scenario).version,
        "options": config.options,
        "profile": config.profile,
        "command": command(config),
        "seed": config.seed,
        "steps": progress.steps,
        "cpu_minutes": round(progress.cpu_seconds / 60, 2),
        "date": datetime.date.today().isoformat(),
        "grades": grades,
    }
    frozen = Frozen(bare.layers, bare.centre, bare.unit, bare.log_std, card)
    out.parent.mkdir(parents=True, exist_ok=True)
    frozen.save(out)
    return frozen


def _last(run: Path) -> Frozen:
    """The last policy of a run."""
    if (run / "last.npz").exists():
        return Frozen.load(run / "last.npz")
    model = PPO.load(run / "last.zip", device="cpu")
    return freeze(model, vars(model)["card"])


def _episodes(policy: Policy, config: TrainConfig) -> dict[str, Any]:
    found = evaluate(
        policy, "frozen", config.scenario, EPISODES, TEST_SEED, config.keywords
    )
    low, high = found.success_interval
    return {"success": found.success, "low": low, "high": high, "episodes": EPISODES}


def _games(policy: Policy, config: TrainConfig) -> dict[str, Any]:
    score, _ = challenge(
        config.scenario,
        policy,
        [make_agent(rival) for rival in config.rivals],
        GAMES,
        TEST_SEED,
        {**config.keywords, "drivers": {}},
    )
    return {
        "games_of_each": GAMES,
        "score": {
            rival: [share, *interval(share, GAMES)]
            for rival, share in zip(config.rivals, score.tolist(), strict=True)
        },
    }


def command(config: TrainConfig) -> str:
    """The line that trains a configuration anew."""
    usual = preset(config.scenario, {"profile": config.profile, "seed": config.seed})
    words = [f"airhockey train {config.scenario} --seed {config.seed}"]
    if config.profile != "ideal":
        words.append(f"--profile {config.profile}")
    words += [f"--option {k}={v}" for k, v in config.options.items()]
    words += [f"--driver {k}={v}" for k, v in config.drivers.items()]
    said = {"scenario", "profile", "options", "drivers", "seed"}
    if not config.self_play:
        said |= {"mirror", "opponents", "script_share", "snapshots", "pool", "priority"}
        said |= {"rivals"}
    for f in fields(config):
        value = getattr(config, f.name)
        if f.name not in said and value != getattr(usual, f.name):
            setting = f"{f.name}={json.dumps(value, separators=(',', ':'))}"
            words.append("--set " + shlex.quote(setting))
    return " ".join(words)
