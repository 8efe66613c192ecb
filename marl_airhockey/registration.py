"""Called by gymnasium when it is imported: register every scenario, import no more."""

from __future__ import annotations

from gymnasium.envs.registration import register

from marl_airhockey.registry import gymnasium_id, scenario_names


def register_all() -> None:
    """Register ``marl_airhockey/CamelCase-v0`` for every file in ``scenarios/``."""
    for name in scenario_names():
        register(
            id=gymnasium_id(name),
            entry_point="marl_airhockey.single:make_single",
            kwargs={"scenario": name},
        )
