"""Registration of every scenario with gymnasium and PettingZoo, at the import.

Gymnasium has had no entry points for plugins since 1.0, and PettingZoo has none. An id
is therefore known after ``import marl_airhockey``. Gymnasium also accepts the module in
the id, as in ``marl_airhockey:marl_airhockey/Juggle-v0``.
"""

from __future__ import annotations

import gymnasium
import pettingzoo

from marl_airhockey.discovery import gymnasium_id, names_in, pettingzoo_id


def register_all() -> None:
    """Register ids of every scenario.

    They are ``marl_airhockey/Juggle-v0`` in gymnasium, and ``marl_airhockey/juggle-v0``
    in PettingZoo, whose names are lower-case.

    The ids have no length, because ``gymnasium.make`` would end episodes there even if
    a keyword makes them longer. The environments fill it in, see `episode_length`.
    """
    for name in names_in("scenarios"):
        kwargs = {"scenario": name}
        # AgileRL needs an older PettingZoo, which has no registry.
        if hasattr(pettingzoo, "register"):
            for kind, function in (("parallel", "parallel_env"), ("aec", "env")):
                where = f"marl_airhockey.make:{function}"
                pettingzoo.register(kind, pettingzoo_id(name), where, kwargs=kwargs)
        gymnasium.register(
            id=gymnasium_id(name),
            entry_point="marl_airhockey.envs.gymnasium_env:make_single",
            vector_entry_point="marl_airhockey.envs.gymnasium_vec_env:make_vector",
            kwargs=kwargs,
        )
