"""Rollout: episodes of a driver, one after the other, as arrays."""

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
"""Number of episodes that are played in one batch"""


def rollout(
    player: object,
    scenario: str | Scenario | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    columns: Collection[str] | None = None,
    **keywords: Unpack[Keywords],
) -> Generator[Episode]:
    """Let a driver play episodes at ``paddle_0`` and yield each of them.

    What is not given is that of a policy's training, as in `evaluate`. An episode has
    the columns of a recording, see docs/data.md: ``episode.first["state.position"]``,
    (bodies, 2), is what there was before the first step, and
    ``episode.columns["reward"]``, (T, seats), what came of each step.

    Args:
        player: Driver, or what makes one, see `registry.make_driver`.
        scenario: Scenario, see `registry.find_scenario`; None for that of training.
        episodes: Number of episodes; episode i has the seed ``seed + i``.
        seed: Seed of the first episode.
        columns: Names of the columns that are kept; None for all.
        **keywords: Keywords of the environment, drivers of other seats among them; see
            `build_world`.

    Raises:
        ValueError: A seat without a driver, one that does not fit, an unknown column,
            or a reward term that is nan; named.
    """
    episodes, seed = check_count("episodes", episodes), check_seed(seed)
    driver, keywords = make_driver(player), table_keywords(keywords)
    scenario, keywords = as_trained({"player": driver}, scenario, keywords)
    driver = seen_in(driver, keywords)
    # On a real table episodes follow each other; elsewhere many are played at once.
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
    """Play episodes in B worlds, B at once, and yield each of them.

    Args:
        world: Worlds without open seats, which do not restart.
        episodes: Number of episodes; episode i has the seed ``seed + i``.
        seed: Seed of the first episode.
        columns: Names of the columns that are kept, as far as the world has them; None
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
