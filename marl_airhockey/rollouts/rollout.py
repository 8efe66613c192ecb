"""Rollout: episodes of a driver as arrays."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator
from typing import Unpack

import numpy as np

from marl_airhockey.build import build_driven_world, table_keywords
from marl_airhockey.registry import DEFAULT_BACKEND, is_live, make_driver
from marl_airhockey.rollouts.as_trained import as_trained, seen_in
from marl_airhockey.rollouts.collector import Collector
from marl_airhockey.rollouts.columns import step_columns
from marl_airhockey.rollouts.play import play
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.checks import check_count, check_seed
from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.core.recording import PLAYED, Episode
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World

AT_ONCE = 64
"""Largest number of episodes that are played in one batch."""


def rollout(
    player: object,
    scenario: str | Scenario | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    columns: Collection[str] | None = None,
    **keywords: Unpack[Keywords],
) -> Generator[Episode]:
    """Play episodes with a driver at ``paddle_0`` and yield each of them.

    Keywords that are not given are those of the policy's training, as in `evaluate`. An
    episode has the columns of a recording, see docs/formats.md. For example,
    ``episode.first["state.position"]`` (bodies, 2) is the value before the first step.
    ``episode.columns["reward"]`` (T, seats) contains a value for each step.

    Args:
        player: Driver, or an argument of `registry.make_driver`.
        scenario: Scenario, see `registry.find_scenario`; None for the scenario of the
            training.
        episodes: Number of episodes. Episode i has the seed ``seed + i``.
        seed: Seed of the first episode.
        columns: Names of the stored columns; None for all.
        **keywords: Shared keywords, see `make.parallel_env`. ``drivers`` are those of
            the other seats.

    Raises:
        ValueError: A seat has no driver, a driver does not fit, a column is unknown, or
            a reward term is nan. The message names it.
    """
    episodes, seed = check_count("episodes", episodes), check_seed(seed)
    driver, keywords = make_driver(player), table_keywords(keywords)
    scenario, keywords = as_trained({"player": driver}, scenario, keywords)
    driver = seen_in(driver, keywords)
    # Many episodes are played in parallel, except on a real table.
    real = is_live(keywords.get("backend", DEFAULT_BACKEND))
    at_once = 1 if real else min(episodes, AT_ONCE)
    world = build_driven_world(driver, scenario, at_once, keywords)
    return _closing(world, episodes, seed, columns)


def _closing(
    world: World, episodes: int, seed: int, columns: Collection[str] | None
) -> Generator[Episode]:
    """Yield the episodes, then close the world."""
    try:
        for episode in play_episodes(world, episodes, seed, columns):
            for name in set(columns or ()) - episode.columns.keys():
                known = step_columns(world)
                raise ValueError(f"columns: {unknown_name('column', name, known)}")
            yield episode
    finally:
        world.close()


def play_episodes(
    world: World,
    episodes: int,
    seed: int,
    columns: Collection[str] | None = None,
) -> Iterator[Episode]:
    """Play episodes in batches of B worlds and yield each of them.

    Args:
        world: Worlds without open seats, which do not restart.
        episodes: Number of episodes. Episode i has the seed ``seed + i``.
        seed: Seed of the first episode.
        columns: Names of the stored columns, without those that the world lacks; None
            for all.
    """
    b = world.num_worlds
    for first in range(0, episodes, b):
        world.reset(seed + first)
        collector, count = Collector(world, columns), min(b, episodes - first)
        lengths, reasons = np.zeros(b, np.int64), [PLAYED] * count
        for step in play(world):
            collector.add()
            lengths += step.live
            if step.result.interruption:
                reasons[0] = step.result.interruption
        yield from collector.episodes(lengths[:count], reasons, first)
