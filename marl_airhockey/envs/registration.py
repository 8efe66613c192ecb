"""Registration of every scenario with gymnasium, when this package is imported.

Gymnasium has had no entry points for plugins since 1.0. An id is therefore known after
``import marl_airhockey``, or with the module in the id, as in
``marl_airhockey:marl_airhockey/Juggle-v0``.
"""

from __future__ import annotations

from gymnasium.envs.registration import register

from marl_airhockey.discovery import gymnasium_id, names_in


def register_all() -> None:
    """Register an id such as ``marl_airhockey/Juggle-v0`` for every scenario.

    The ids have no length, because ``gymnasium.make`` would end episodes there even if
    a keyword makes them longer. The environments fill it in, see `episode_length`.
    """
    for name in names_in("scenarios"):
        register(
            id=gymnasium_id(name),
            entry_point="marl_airhockey.envs.gymnasium_env:make_single",
            vector_entry_point="marl_airhockey.envs.gymnasium_vec_env:make_vector",
            kwargs={"scenario": name},
        )
