"""Options of `reset` that all environments share."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

from marl_airhockey.core.errors import unknown_name
from marl_airhockey.world.observer import Observation
from marl_airhockey.world.world import World

OPTIONS = ("state", "memory")


def reset_world(
    world: World, seed: int | Sequence[int] | None, options: dict[str, Any] | None
) -> Observation:
    """Reset worlds, to given states if the options hold them.

    Other options pass unheeded, as conformance tests send some, but for misspelt ones.

    Args:
        world: the worlds.
        seed: see `World.reset`.
        options: ``state`` and ``memory`` of `World.set_state`, both optional.

    Raises:
        ValueError: a misspelt option, or a state that does not fit, named.
    """
    given = options or {}
    for name in given:
        if name not in OPTIONS and get_close_matches(name, OPTIONS):
            raise ValueError(unknown_name("reset option", name, OPTIONS))
    if "memory" in given and "state" not in given:
        raise ValueError("reset options: a memory needs its state")
    observation = world.reset(seed)
    if "state" not in given:
        return observation
    return world.set_state(given["state"], given.get("memory"))
