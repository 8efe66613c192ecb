"""Candidates of set pieces: starts before anything is known about them."""

from __future__ import annotations

import numpy as np

from marl_airhockey.build import build_driven_world
from marl_airhockey.policies.load import ZOO, load_policy
from marl_airhockey.types import Array

Starts = tuple[Array, Array]
"""Positions and velocities (n, bodies, 2) of candidates, m and m/s."""
Range = tuple[float, float]
FREE = 0.09
"""Smallest distance between the centres of two bodies, m."""
REACTION, ROOM = 0.15, np.array([0.80, 0.27])
"""Reaction time of the games, s, and largest distances of a puck from the centre, m."""
ASIDE = (-0.25, 0.25)
"""Range of the positions across the table, m."""


def within(rng: np.random.Generator, n: int, x: Range, y: Range = ASIDE) -> Array:
    """Return points (n, 2) in a box."""
    return np.stack([rng.uniform(*x, n), rng.uniform(*y, n)], -1)


def moving(
    rng: np.random.Generator, n: int, middle: float, wide: float, speed: Range
) -> Array:
    """Return velocities (n, 2) in directions around a middle one, rad."""
    angle = middle + rng.uniform(-wide, wide, n)
    unit = np.stack([np.cos(angle), np.sin(angle)], -1)
    return np.asarray(rng.uniform(*speed, n)[:, None] * unit)


def placed(paddles: list[Array], puck: Array, velocity: Array) -> Starts:
    """Return the candidates whose bodies are apart, on their sides and in flight.

    The puck has moved at its velocity for the reaction time, without a bounce.
    """
    position = np.stack([*paddles, puck], 1)
    bodies, own = position.shape[1], len(paddles) // 2
    moves = np.zeros_like(position)
    moves[:, -1] = velocity
    apart = np.linalg.norm(position[:, :, None] - position[:, None], axis=-1)
    apart += np.eye(bodies)
    x, y = position[..., 0], position[..., 1]
    fits = (apart >= FREE - 1e-9).all((1, 2)) & (np.abs(x) < 0.78).all(1)
    fits &= (np.abs(y) <= ASIDE[1]).all(1) & (x[:, :own] < -0.06).all(1)
    fits &= (x[:, own:-1] > 0.06).all(1)
    fits &= (np.abs(puck - REACTION * velocity) < ROOM).all(1)
    return position[fits], moves[fits]


def shots(rng: np.random.Generator, n: int) -> Starts:
    """Shots in flight."""
    puck, own = within(rng, n, (-0.3, 0.7)), within(rng, n, (-0.75, -0.15))
    other = within(rng, n, (0.3, 0.75))
    return placed([own, other], puck, moving(rng, n, np.pi, 1.3, (1.0, 7.0)))


def slow_pucks(rng: np.random.Generator, n: int) -> Starts:
    """Slow pucks in reach, and a goalkeeper before its goal."""
    puck, own = within(rng, n, (-0.7, -0.1)), within(rng, n, (-0.75, -0.1))
    keeper = within(rng, n, (0.55, 0.72), (-0.15, 0.15))
    return placed([own, keeper], puck, moving(rng, n, 0.0, np.pi, (0.0, 0.5)))


def counters(rng: np.random.Generator, n: int) -> Starts:
    """Pucks that come, and a goalkeeper far from its goal."""
    puck, own = within(rng, n, (-0.1, 0.3)), within(rng, n, (-0.75, -0.3))
    keeper = within(rng, n, (0.06, 0.35))
    return placed([own, keeper], puck, moving(rng, n, np.pi, 0.8, (1.0, 4.0)))


def passes(rng: np.random.Generator, n: int) -> Starts:
    """Slow pucks near the first of two teammates, in doubles."""
    puck = within(rng, n, (-0.6, -0.15))
    own = puck + moving(rng, n, np.pi, 1.5, (FREE, 0.2))
    paddles = [own, within(rng, n, (-0.7, -0.1))]
    paddles += [within(rng, n, (0.3, 0.7)) for _ in range(2)]
    return placed(paddles, puck, moving(rng, n, 0.0, np.pi, (0.0, 0.4)))


def played(rng: np.random.Generator, n: int) -> Starts:
    """Situations of games between two copies of zoo/duel, every 0.5 s."""
    player = load_policy(ZOO / "duel.npz", deterministic=False)
    games = 1 + n // 100
    world = build_driven_world(player, "duel", games, {"drivers": {"paddle_1": player}})
    world.reset(int(rng.integers(2**40)))
    found = []
    for step in range(1, 1001):
        world.step(np.zeros((games, 0, 2)))
        if step % 10 == 0:
            found.append(world.state)
    world.close()
    bodies = found[0].bodies.movers
    parts = ("position", "velocity")
    position, velocity = (
        np.concatenate([getattr(s, name)[:, :bodies] for s in found]) for name in parts
    )
    gap = np.linalg.norm(position[:, :2] - position[:, 2:], axis=-1).min(1)
    past = position[:, 2] - REACTION * velocity[:, 2]
    fits = (gap > FREE) & (np.abs(past) < ROOM).all(1)
    chosen = rng.permutation(np.flatnonzero(fits))[:n]
    return position[chosen], velocity[chosen]
