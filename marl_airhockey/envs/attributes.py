"""Check of the attributes that users set on an environment after its creation."""

from __future__ import annotations

from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World

LIKE = 0.8
"""Smallest similarity, 0 to 1, from which a name counts as a misspelling."""


class CheckedAttributes:
    """Mixin that forbids setting what is fixed when an environment is created.

    Other names are stored, because learning libraries store attributes of their own.
    """

    world: World

    def __setattr__(self, name: str, value: Any) -> None:
        world = self.__dict__.get("world")
        known = name in self.__dict__ or hasattr(type(self), name)
        if world is not None and not (known or name.startswith("_")):
            refuse_built(world, name)
        super().__setattr__(name, value)


def refuse_built(world: World, name: str) -> None:
    """Raise an error for the name of a keyword or an option, or for a misspelling.

    Raises:
        AttributeError: The name is one of these. The message states what to do.
    """
    options = [field.name for field in fields(world.scenario)]
    names = [*Keywords.__annotations__, *options]
    if name in names:
        given = f"{name}=..." if name not in options else f'options={{"{name}": ...}}'
        raise AttributeError(
            f"{name!r} cannot be set after the environment is created; create one with "
            f"{given}"
        )
    near = get_close_matches(name, names, 1, LIKE)
    if near:
        raise AttributeError(f"unknown attribute {name!r}; did you mean {near[0]!r}?")
