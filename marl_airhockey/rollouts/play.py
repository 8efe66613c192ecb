"""Play: the loop over control steps until every episode of a batch is over."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array


class Played(NamedTuple):
    """Control step of B worlds that has been played."""

    result: StepResult
    live: Array
    """(B,) bool: the step belongs to the episode, which had not ended before"""
    ended: Array
    """(B,) bool: the episode ended with this step"""


def play(
    world: World, act: Callable[[Array], None] = lambda actions: None
) -> Iterator[Played]:
    """Play the running episode of each of B worlds to its end.

    Worlds whose episode is over move on with all others until the last one has ended.

    Args:
        world: Worlds that have been reset and do not restart (``autoreset=False``).
        act: Function that fills in the actions (B, open, 2) of open seats in place;
            they begin at 0. Without open seats there is nothing to fill in.

    Yields:
        Each control step, as soon as it is made.

    Raises:
        ValueError: A reward term is nan at the end of an episode; named.
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
