"""Hashes of games: a check that a machine computes the same bits as all others.

A fixed list of games is played with fixed seeds. The hash of a game includes every
state, observation and reward. `KNOWN` contains the hashes of this version.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.registry import (
    find_scenario,
    make_driver,
    scenario_names,
    zoo_names,
)
from marl_airhockey.rollouts.as_trained import as_trained
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.world import World

KNOWN = Path(__file__).parent / "hashes.json"
"""File with the hashes of the games, by name."""
STEPS = 2000
"""Number of control steps of a game."""
SEED = 20261128
"""Seed of all games."""
IMAGES = "pixels:colour=rgb,frames=2"
"""Observation type of the games with images."""
FRAMES = "camera:colour=rgb,frames=2"
"""Observation type of the games with a camera."""
SCRIPT = "allround"
"""Script that plays in every scenario."""


class FixedGame(NamedTuple):
    """Game of the list."""

    name: str
    scenario: str
    keywords: Keywords


def games() -> Iterator[FixedGame]:
    """Yield all games: scripts, images, cameras, "ur5e", and policies of the zoo."""
    for scenario in scenario_names():
        scripted = Keywords(drivers=_drivers(scenario, SCRIPT))
        yield FixedGame(f"{scenario} with {SCRIPT}", scenario, scripted)
        images = Keywords(observe=IMAGES)
        yield FixedGame(f"{scenario} with images", scenario, images)
        if len(find_scenario(scenario).scene.seats) == 1:
            frames = Keywords(observe=FRAMES)
            yield FixedGame(f"{scenario} with a camera", scenario, frames)
        keywords = Keywords(profile="ur5e")
        yield FixedGame(f"{scenario} with random actions in ur5e", scenario, keywords)
    for name in zoo_names():
        found, keywords = as_trained({name: make_driver(name)}, None, {})
        scenario = str(found)
        keywords["drivers"] = _drivers(scenario, name)
        yield FixedGame(f"{scenario} with {name}", scenario, keywords)


def play(game: FixedGame, steps: int = STEPS) -> str:
    """Play a game; return the SHA-256 of its states, observations and rewards."""
    world = build_world(game.scenario, 1, True, game.keywords)
    digest = hashlib.sha256()
    try:
        for numbers in _numbers(world, steps):
            # Adding 0 removes the sign of zeros, which rules in plain NumPy can change.
            digest.update((numbers + numbers.dtype.type(0)).tobytes())
    finally:
        world.close()
    return digest.hexdigest()


def known() -> Mapping[str, str]:
    """Return the hashes of this version by the names of the games."""
    found: Mapping[str, str] = json.loads(KNOWN.read_text())
    return found


def _drivers(scenario: str, driver: str) -> dict[str, object]:
    seats = range(len(find_scenario(scenario).scene.seats))
    return {f"paddle_{i}": driver for i in seats}


def _numbers(world: World, steps: int) -> Iterator[Any]:
    """Yield the arrays of a game, step by step."""
    seats = len(world.open)
    actions = RandomStreams.keyed(np.array([SEED]), np.array([1]), "actions")
    world.reset(seed=SEED)
    for _ in range(steps):
        result = world.step(actions.uniform(-1.0, 1.0, seats, 2))
        state = world.state
        yield from (state.position, state.velocity, state.angle, state.spin)
        shown = world.observe(np.arange(seats))
        yield world.outcome["reward"]
        yield from shown.values() if isinstance(shown, Mapping) else (shown,)
        yield from (result.terminated, result.truncated)
