"""Algorithms by name, and the configurations of their runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from marl_airhockey.learn.hindsight.config import ALGO as SAC_HER
from marl_airhockey.learn.hindsight.config import HindsightConfig, hindsight_config
from marl_airhockey.learn.offline.config import ALGORITHMS as OFFLINE
from marl_airhockey.learn.offline.config import OfflineConfig, offline_config
from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.settings import load_config, read_settings
from marl_airhockey.sim.core.errors import unknown_name

AnyConfig = PPOConfig | OfflineConfig | HindsightConfig
"""Configuration of a run of any algorithm"""
PPO = "ppo"
"""Default algorithm"""
PLAYING: dict[str, Callable[[str, Mapping[str, Any]], AnyConfig]] = {
    PPO: preset,
    SAC_HER: hindsight_config,
}
"""Makers of configurations of what learns by playing, by algorithm"""
APART = ("scenario", "algo", "data")
"""Fields of configurations that are no settings, as they are arguments"""
KINDS: dict[str, type[AnyConfig]] = {
    PPO: PPOConfig,
    SAC_HER: HindsightConfig,
    **dict.fromkeys(OFFLINE, OfflineConfig),
}
"""Classes of configurations, by algorithm"""


def make_config(
    algo: str,
    scenario: str,
    data: Sequence[str | Path],
    settings: Mapping[str, Any],
) -> AnyConfig:
    """Return the configuration of a new run.

    Args:
        algo: name of the algorithm.
        scenario: its name; "" for that of the recordings.
        data: recordings and folders of them, for what learns from them.
        settings: changes of its settings, by name.

    Raises:
        ValueError: an unknown name, a bad setting, data that are missing or that
            nothing is learned from.
    """
    for name in APART:
        if name in settings:
            raise ValueError(f"{name}: it is no setting of a run; name it apart")
    if algo in KINDS:
        _check_settings(algo, settings)
    if algo in OFFLINE:
        if not data:
            raise ValueError(
                f"data: {algo} learns from recordings; name some with --data"
            )
        named = {"scenario": scenario} if scenario else {}
        return offline_config(algo, data, {**settings, **named})
    if algo not in PLAYING:
        raise ValueError(unknown_name("algo", algo, [*PLAYING, *OFFLINE]))
    if data:
        others = " or ".join(OFFLINE)
        raise ValueError(f"data: {algo} learns by playing; from data do {others}")
    if not scenario:
        raise ValueError("say which SCENARIO to train")
    return PLAYING[algo](scenario, settings)


def _check_settings(algo: str, settings: Mapping[str, Any]) -> None:
    """Refuse settings that only other algorithms have.

    Raises:
        ValueError: One of these, with the algorithms.
    """
    has = {name: {f.name for f in fields(kind)} for name, kind in KINDS.items()}
    for name in settings.keys() - has[algo]:
        if others := [other for other in KINDS if name in has[other]]:
            raise ValueError(
                f"{name}: {algo} has no such setting, only {', '.join(others)}"
            )


def load_any_config(folder: Path) -> AnyConfig:
    """Read the configuration of a run of any algorithm.

    Raises:
        ValueError: see `settings.read_settings`.
    """
    path = folder / "config.toml"
    algo = read_settings(path).get("algo", PPO)
    if algo not in KINDS:
        raise ValueError(f"{path}: {unknown_name('algo', algo, KINDS)}")
    return load_config(KINDS[algo], path)
