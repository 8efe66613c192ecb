"""What seats observe of each other."""

import numpy as np
from pair import Pair

import marl_airhockey as ah


def mirrored(world):
    """The same worlds, seen from the other end."""
    flipped = world.state
    for name in ("position", "velocity"):
        getattr(flipped, name)[:] = -getattr(world.state, name)[:, [1, 0, 2]]
    other = ah.make_world(Pair(), world.num_worlds)
    other.reset(0)
    other.set_state(flipped)
    return other


def test_swapping_the_ends_swaps_observations_and_rewards():
    world = ah.make_world(Pair(), 6)
    world.reset(3)
    other = mirrored(world)
    rng = np.random.default_rng(0)
    scored = 0
    for _ in range(120):
        gap = world.state.puck - world.state.paddle
        gap[:, 1] *= -1
        actions = np.clip(6 * gap, -1, 1) + rng.normal(0, 0.3, (6, 2, 2))
        one, two = world.step(actions), other.step(actions[:, ::-1])
        # Until the first serve, which each draws for itself.
        np.testing.assert_allclose(one.reward, two.reward[:, ::-1], atol=1e-9)
        scored += int(np.abs(one.reward).sum())
        if scored:
            break
        np.testing.assert_allclose(one.observation, two.observation[:, ::-1], atol=1e-5)
    assert scored


def test_opponents_are_seen_from_ones_own_end():
    world = ah.make_world(Pair(), 1)
    seen = world.reset(0)
    labels = world.observer.layout.labels
    own = [labels.index("own.x"), labels.index("own.y")]
    other = [labels.index("other_0.x"), labels.index("other_0.y")]
    np.testing.assert_allclose(seen[0, 0, own], [-0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(seen[0, 1, own], [-0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(
        seen[0, :, other],
        [[0.5, 0.5], [0.0, 0.0]],
        atol=1e-6,
    )
