"""Options of `reset` that all environments share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

import numpy as np

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.world.observer import Observation
from marl_airhockey.sim.world.world import World

OPTIONS = ("state", "memory")
MASK = "reset_mask"
"""Further option of `reset` of a vector environment"""


def check_options(world: World, options: Any, known: Sequence[str] = OPTIONS) -> None:
    """Refuse a misspelt option, a scenario's field, and a memory without its state.

    Other options pass unheeded, as conformance tests send some.

    Args:
        world: Worlds that are reset.
        options: Options that were given.
        known: Names of the options that exist.

    Raises:
        ValueError: One of these, named, or options that are no dict.
    """
    if not isinstance(options, Mapping):
        raise ValueError(f"reset options: {options!r} is no dict")
    own = [field.name for field in fields(world.scenario)]
    for name in options.keys() - {*known}:
        if name in own:
            raise ValueError(
                f"reset options: {name!r} is a field of {world.scenario.name}; set it "
                f'where the environment is built, options={{"{name}": ...}}'
            )
        if get_close_matches(name, known):
            raise ValueError(unknown_name("reset option", name, known))
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
    given = {} if options is None else options
    check_options(world, given)
    observation = world.reset(seed)
    if "state" not in given:
        return observation
    return world.set_state(given["state"], given.get("memory"))


def reset_each(
    world: World, seed: Sequence[int] | None, options: Sequence[Mapping[str, Any]]
) -> Observation:
    """Reset worlds with options for each, see `reset_world`."""
    for given in options:
        check_options(world, given)
    observation = world.reset(seed)
    for i, given in enumerate(options):
        if "state" in given:
            one = np.array([i])
            observation = world.set_state(given["state"], given.get("memory"), one)
    return observation
