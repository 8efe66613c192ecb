"""Loop over control steps until every episode of a batch has ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array


class Played(NamedTuple):
    """Control step of B worlds."""

    result: StepResult
    live: Array
    """True if the episode had not ended before this step (B,)."""
    ended: Array
    """True if the episode ended with this step (B,)."""


def play(
    world: World, act: Callable[[Array], None] = lambda actions: None
) -> Iterator[Played]:
    """Play the running episode of each of B worlds to its end.

    All worlds are stepped until the last episode has ended.

    Args:
        world: Worlds that have been reset and do not restart (``autoreset=False``).
        act: Function that writes the actions (B, open, 2) of open seats in place. They
            are 0 at first. Without open seats it is not needed.

    Yields:
        Each control step, immediately after it.

    Raises:
        ValueError: A reward term is nan at the end of an episode. The message names it.
    """
    actions = np.zeros((world.num_worlds, len(world.open), 2))
    live = np.ones(world.num_worlds, np.bool_)
    while live.any():
        act(actions)
        result = world.step(actions)
        ended = live & (result.terminated | result.truncated)
        if ended.any():
            _check_rewards(world)
        yield Played(result, live.copy(), ended)
        live &= ~ended


def _check_rewards(world: World) -> None:
    if np.isnan(world.episode.returns).any():
        bad = [name for name, term in world.terms.items() if np.isnan(term).any()]
        raise ValueError(f"{world.scenario.name}: reward terms {bad} are nan")
