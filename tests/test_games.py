"""What games need of the core: seats, ends, serving inside an episode."""

import numpy as np
import pytest
from pair import Pair
from pettingzoo.test import parallel_api_test

import marl_airhockey as ah


def test_two_open_seats_pass_pettingzoos_test():
    parallel_api_test(ah.parallel_env(Pair()), num_cycles=400)


def test_a_driven_seat_makes_it_a_single_agent_environment():
    env = ah.parallel_env(Pair(), drivers={"paddle_0": "goalkeeper"})
    env.reset(seed=0)
    assert env.agents == ["paddle_1"]
    assert env.teams == {0: ["paddle_0"], 1: ["paddle_1"]}
    vec = ah.make_vec(Pair(), 4, drivers={"paddle_0": "random"})
    seen, _ = vec.reset(seed=0)
    assert seen.shape == (4, len(env.observation_labels("paddle_1")))
    with pytest.raises(ValueError, match="needs exactly one"):
        ah.make_vec(Pair(), 4)


def mirrored(world):
    """The same worlds, seen from the other end."""
    turned = world.state.map(np.copy)
    for name in ("position", "velocity"):
        getattr(turned, name)[:] = -getattr(world.state, name)[:, [1, 0, 2]]
    other = ah.make_world(Pair(), world.num_worlds)
    other.reset(0)
    other._place(np.arange(world.num_worlds), turned, other.memory)
    other._sensed = other._look(np.arange(world.num_worlds))
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


def test_the_game_goes_on_after_a_goal():
    world = ah.make_world(Pair(), 8, max_cycles=200)
    world.autoreset = False
    world.reset(1)
    goals = np.zeros((8, 2))
    for _ in range(200):
        gap = world.state.puck - world.state.paddle
        gap[:, 1] *= -1
        before = world.state
        step = world.step(np.clip(8 * gap, -1, 1))
        goals += step.reward > 0
        served = world.state.time[:, None] * np.ones((1, 1))
        assert (served[:, 0] > before.time).all()
        np.testing.assert_allclose(step.reward.sum(-1), 0.0)
    np.testing.assert_array_equal(goals, world.memory["goals"])
    assert goals.sum() > 4
    assert step.truncated.all()
    assert not step.terminated.any()


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
        0.5 * np.eye(2)[[0, 1]][:, :1] * 0 + [[0.5, 0.5], [0.0, 0.0]],
        atol=1e-6,
    )
