"""Options of `reset` that all environments share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np

from marl_airhockey.core.errors import unknown_name
from marl_airhockey.world.observer import Observation
from marl_airhockey.world.world import World

OPTIONS = ("state", "memory")


def check_options(options: Mapping[str, Any]) -> None:
    """Refuse a misspelt option, and a memory without its state.

    Other options pass unheeded, as conformance tests send some.

    Raises:
        ValueError: One of these, named.
    """
    for name in options:
        if name not in OPTIONS and get_close_matches(name, OPTIONS):
            raise ValueError(unknown_name("reset option", name, OPTIONS))
    if "memory" in options and "state" not in options:
        raise ValueError("reset options: a memory needs its state")


def reset_world(
    world: World, seed: int | Sequence[int] | None, options: dict[str, Any] | None
) -> Observation:
    """Reset worlds, to given states if the options hold them.

    Args:
        world: Worlds.
        seed: See `World.reset`.
        options: ``state`` and ``memory`` of `World.set_state`, both optional.

    Raises:
        ValueError: A bad option, see `check_options`, or a state that does not fit.
    """
    given = options or {}
    check_options(given)
    observation = world.reset(seed)
    if "state" not in given:
        return observation
    return world.set_state(given["state"], given.get("memory"))


def reset_each(
    world: World, seed: Sequence[int] | None, options: Sequence[Mapping[str, Any]]
) -> Observation:
    """Reset worlds with options for each, see `reset_world`."""
    for given in options:
        check_options(given)
    observation = world.reset(seed)
    for i, given in enumerate(options):
        if "state" in given:
            one = np.array([i])
            observation = world.set_state(given["state"], given.get("memory"), one)
    return observation
