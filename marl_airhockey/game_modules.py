"""Modules of games as in PettingZoo: ``from marl_airhockey import duel_v1``."""

from __future__ import annotations

import re
from functools import partial
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from marl_airhockey.discovery import names_in, version_of

VERSIONED = re.compile(r"([a-z]\w*)_v(\d+)")
"""Name of a scenario and its version."""


class GameFinder(MetaPathFinder, Loader):
    """Finder of modules of games, for ``duel_v1.parallel_env()``.

    Both ``from marl_airhockey import duel_v1`` and ``import marl_airhockey.duel_v1``
    use it.
    """

    def find_spec(
        self, fullname: str, path: object, target: object = None
    ) -> ModuleSpec | None:
        """Return the spec of a scenario with a version; None for other names.

        Raises:
            ImportError: The scenario has another version.
        """
        package, _, name = fullname.rpartition(".")
        found = VERSIONED.fullmatch(name)
        if package != __package__ or not found or found[1] not in names_in("scenarios"):
            return None
        current = version_of(found[1])
        if int(found[2]) != current:
            raise ImportError(
                f"{name}: this release of marl_airhockey contains {found[1]}_v{current}"
            )
        return ModuleSpec(fullname, self, loader_state=found[1])

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module of a game."""
        from marl_airhockey.make import env, parallel_env

        module = ModuleType(spec.name, f"PettingZoo game {spec.loader_state}.")
        vars(module)["parallel_env"] = partial(parallel_env, spec.loader_state)
        vars(module)["env"] = partial(env, spec.loader_state)
        vars(module)["raw_env"] = module.env
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing, because `create_module` returns the complete module."""
