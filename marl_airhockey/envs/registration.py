"""Tell gymnasium of every scenario, when this package is imported.

Gymnasium has had no entry points for plugins since 1.0: an id is known after ``import
marl_airhockey``, or with the module named before it,
``marl_airhockey:marl_airhockey/Juggle-v0``.
"""

from __future__ import annotations

from gymnasium.envs.registration import register

from marl_airhockey.discovery import gymnasium_id, names_in


def register_all() -> None:
    """Register ``marl_airhockey/CamelCase-v0`` for every file in ``scenarios/``.

    Without a length: ``gymnasium.make`` would end episodes there that keywords make
    longer. The environments fill in their own, see `episode_length`.
    """
    for name in names_in("scenarios"):
        register(
            id=gymnasium_id(name),
            entry_point="marl_airhockey.envs.gymnasium_env:make_single",
            vector_entry_point="marl_airhockey.envs.gymnasium_vec_env:make_vector",
            kwargs={"scenario": name},
        )
