"""Called by gymnasium when it is imported: register every scenario, import no more."""

from __future__ import annotations

from gymnasium.envs.registration import register

from marl_airhockey.registry import scenario_names, scenario_version


def register_all() -> None:
    """Register ``marl_airhockey/CamelCase-v0`` for every file in ``scenarios/``."""
    for name in scenario_names():
        camel = "".join(word.capitalize() for word in name.split("_"))
        register(
            id=f"marl_airhockey/{camel}-v{scenario_version(name)}",
            entry_point="marl_airhockey.single:make_single",
            kwargs={"scenario": name},
        )
