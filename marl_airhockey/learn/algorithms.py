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
"""Configuration of a run of any algorithm."""
PPO = "ppo"
"""Name of the default algorithm."""
PLAYING: dict[str, Callable[[str, Mapping[str, Any]], AnyConfig]] = {
    PPO: preset,
    SAC_HER: hindsight_config,
}
"""Makers of configurations of algorithms that learn in simulation, by algorithm."""
APART = ("scenario", "algo", "data")
"""Fields of configurations that are arguments instead of settings."""
KINDS: dict[str, type[AnyConfig]] = {
    PPO: PPOConfig,
    SAC_HER: HindsightConfig,
    **dict.fromkeys(OFFLINE, OfflineConfig),
}
"""Classes of configurations, by algorithm."""


def make_config(
    algo: str,
    scenario: str,
    data: Sequence[str | Path],
    settings: Mapping[str, Any],
) -> AnyConfig:
    """Return the configuration of a new run.

    Args:
        algo: Name of the algorithm.
        scenario: Name of the scenario; "" for that of the recordings.
        data: Recordings, and folders of recordings, for offline algorithms.
        settings: Changed settings, by name.

    Raises:
        ValueError: A name is unknown, a setting is invalid, recordings are missing, or
            they were given to an algorithm that does not use them.
    """
    for name in APART:
        if name in settings:
            raise ValueError(f"{name}: this is an argument, not a setting of a run")
    if algo in KINDS:
        _check_settings(algo, settings)
    if algo in OFFLINE:
        if not data:
            raise ValueError(
                f"data: {algo} learns from recordings; give them with --data"
            )
        named = {"scenario": scenario} if scenario else {}
        return offline_config(algo, data, {**settings, **named})
    if algo not in PLAYING:
        raise ValueError(unknown_name("algo", algo, [*PLAYING, *OFFLINE]))
    if data:
        others = " or ".join(OFFLINE)
        raise ValueError(
            f"data: {algo} learns in simulation and uses no recordings; use {others}"
        )
    if not scenario:
        raise ValueError("scenario: none was given; name the SCENARIO to train")
    return PLAYING[algo](scenario, settings)


def _check_settings(algo: str, settings: Mapping[str, Any]) -> None:
    """Check that an algorithm has the settings.

    Raises:
        ValueError: Only other algorithms have a setting. The message names them.
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
        ValueError: The file is not a valid configuration, see `settings.read_settings`.
    """
    path = folder / "config.toml"
    algo = read_settings(path).get("algo", PPO)
    if algo not in KINDS:
        raise ValueError(f"{path}: {unknown_name('algo', algo, KINDS)}")
    return load_config(KINDS[algo], path)
