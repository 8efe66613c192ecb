"""Options of `reset` that all environments share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

import numpy as np

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.world.observation import Observation
from marl_airhockey.sim.world.world import World

OPTIONS = ("state", "memory")
MASK = "reset_mask"
"""Additional option of `reset` of a vector environment."""


def check_options(world: World, options: Any, known: Sequence[str] = OPTIONS) -> None:
    """Check the options of a reset.

    Other unknown options are ignored, because conformance tests send some.

    Args:
        world: Worlds that are reset.
        options: Options of the reset.
        known: Names of the known options.

    Raises:
        ValueError: The options are not a dict, or one of them is misspelt, a field of
            the scenario, or a memory without a state. The message names it.
    """
    if not isinstance(options, Mapping):
        raise ValueError(f"reset options: {options!r}; expected a dict")
    own = [field.name for field in fields(world.scenario)]
    for name in options.keys() - {*known}:
        if name in own:
            raise ValueError(
                f"reset options: {name!r} is a field of {world.scenario.name}; set it "
                f'when the environment is created, options={{"{name}": ...}}'
            )
        if get_close_matches(name, known):
            raise ValueError(unknown_name("reset option", name, known))
    if "memory" in options and "state" not in options:
        raise ValueError("reset options: a memory needs a state; give both")


def reset_world(
    world: World, seed: int | Sequence[int] | None, options: dict[str, Any] | None
) -> Observation:
    """Reset worlds, to given states if the options contain them.

    Args:
        world: Worlds to reset.
        seed: Seed as in `World.reset`.
        options: Arguments ``state`` and ``memory`` of `World.set_state`, both optional.

    Raises:
        ValueError: An option is not valid, see `check_options`, or a state is not.
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
    """Reset worlds, each with options of its own, see `reset_world`."""
    for given in options:
        check_options(world, given)
    observation = world.reset(seed)
    for i, given in enumerate(options):
        if "state" in given:
            one = np.array([i])
            observation = world.set_state(given["state"], given.get("memory"), one)
    return observation
