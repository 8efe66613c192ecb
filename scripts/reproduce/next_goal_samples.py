"""Sampled states of duels, each with the side that scored the next goal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from marl_airhockey.build import build_world
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.policies.next_goal import views
from marl_airhockey.rollouts.play import play
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.state import State
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.sim.world.roster import Roster
from marl_airhockey.types import Array

GAME = "duel"
EVERY = 13
"""Number of control steps from one sample to the next. It is not a multiple of the 3
steps from one action to the next, so that samples have all delays after an action."""
BATCH_OF_GAMES = 2000
SHORT = 15.0
"""Length of a game from a random state, s. Most have a goal in this time."""
FASTEST = 4.0
"""Largest speed of the puck in a random state, m/s."""


class Samples(NamedTuple):
    """States at sampled times after which a goal was scored."""

    views: Array
    """Views of both seats (n, 2, 12), float32."""
    scored: Array
    """True if seat 0 scored the next goal (n,)."""
    seconds: Array
    """Time until this goal, s (n,)."""
    game: Array
    """Number of the game (n,)."""


def next_goals(scored: Array) -> tuple[Array, Array]:
    """Return the side of the next goal after each step, and the steps until it.

    Args:
        scored: 1 or -1 at the step in which a side scored, else 0 (T, B).

    Returns:
        Sides (T, B), 0 if no goal follows, and numbers of steps (T, B).
    """
    side, steps = np.zeros((2, *scored.shape), np.int16)
    for t in range(len(scored) - 2, -1, -1):
        now = scored[t + 1] != 0
        side[t] = np.where(now, scored[t + 1], side[t + 1])
        steps[t] = np.where(now, 1, steps[t + 1] + 1)
    return side, steps


def random_state(scene: Scene, rng: np.random.Generator, count: int) -> State:
    """Return states whose bodies have random positions and velocities."""
    state, table = scene.still_state(count), scene.table
    angle = rng.uniform(0.0, 2.0 * np.pi, state.position.shape[:-1])
    fastest = np.array([*(seat.speed for seat in scene.seats), FASTEST])
    speed = rng.uniform(0.0, fastest, angle.shape)
    state.velocity[:] = speed[..., None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    for k, seat in enumerate(scene.seats):
        low, high = np.min(seat.reach, 0), np.max(seat.reach, 0)
        place = rng.uniform(low, high, (count, 2))
        state.paddle[:, k] = place @ table.rotation(seat.side)
    high = table.size / 2 - table.puck_radius
    gap, overlaps = table.paddle_radius + table.puck_radius, np.ones(count, np.bool_)
    while overlaps.any():
        state.puck[overlaps, 0] = rng.uniform(-high, high, (overlaps.sum(), 2))
        overlaps = (np.linalg.norm(state.puck - state.paddle, axis=-1) < gap).any(-1)
    return state


def sample(
    drivers: Sequence[Driver], games: int, seed: int, short: bool = False
) -> Samples:
    """Play games of random pairs of drivers, and return the sampled states.

    Args:
        drivers: Drivers of the players.
        games: Number of games.
        seed: Seed of the first game.
        short: True for games of `SHORT` seconds from random states.
    """
    control_dt = LiveMatch.CONTROL_DT
    forms = [driver.observe for driver in drivers if driver.observe]
    keywords: Keywords = {"control_dt": control_dt}
    if short:
        keywords["options"] = {"seconds": SHORT}
    world = build_world(GAME, games, False, keywords, forms)
    roster = Roster(world)
    for number, driver in enumerate(drivers):
        roster.add(f"player {number}", driver)
    rng = np.random.default_rng(seed)
    roster.seated[:] = rng.integers(len(drivers), size=(games, 2))
    world.reset(seed)
    if short:
        world.set_state(random_state(world.scene, rng, games))
    roster.begin(np.arange(games))
    lead, scored, live, seen = np.zeros(games), [], [], []
    for number, step in enumerate(play(world, roster.ask)):
        goals = world.memory["goals"]
        before, lead = lead, goals[:, 0] - goals[:, 1]
        # Worlds whose game has ended continue until the last game ends.
        scored.append(((lead - before) * step.live).astype(np.int8))
        if number % EVERY == 0:
            live.append(step.live & ~step.ended)
            seen.append(views(world.state, world.scene).astype(np.float32))
    world.close()
    side, steps = (found[::EVERY] for found in next_goals(np.array(scored)))
    valid = np.array(live) & (side != 0)
    game = np.broadcast_to(seed + np.arange(games), valid.shape)
    return Samples(
        np.array(seen)[valid],
        side[valid] > 0,
        steps[valid] * control_dt,
        game[valid],
    )


def sample_many(
    drivers: Sequence[Driver], games: int, seed: int, short: bool = False
) -> Samples:
    """Play games in batches, and return the sampled states; see `sample`."""
    starts = range(0, games, BATCH_OF_GAMES)
    sizes = [min(BATCH_OF_GAMES, games - k) for k in starts]
    return joined(
        [
            sample(drivers, n, seed + k, short)
            for n, k in zip(sizes, starts, strict=True)
        ]
    )


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of several parts as one."""
    return Samples(*map(np.concatenate, zip(*parts, strict=True)))
