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


def place_puck(world, x, y, vx=0.0, vy=0.0):
    """Put puck 0 of every world somewhere."""
    rows = world.state.map(np.copy)
    rows.puck[:, 0], rows.puck_velocity[:, 0] = (x, y), (vx, vy)
    world._place(np.arange(world.num_worlds), rows, world.memory)
    world._sensed = world._look(np.arange(world.num_worlds))


def idle(world, seconds):
    """Steps of worlds in which nobody moves."""
    still = np.zeros((world.num_worlds, len(world.open), 2))
    return [world.step(still) for _ in range(round(seconds / world.control_dt))]


def test_a_goal_in_a_duel_pays_and_is_served_to_who_conceded(backend):
    world = ah.make_world("duel", 4, backend=backend)
    world.reset(0)
    place_puck(world, 0.75, 0.0, 2.0)
    steps = idle(world, 0.2)
    assert sum(s.reward for s in steps).tolist() == [[1.0, -1.0]] * 4
    assert (world.memory["goals"] == [1, 0]).all()
    assert (world.state.puck_velocity[:, 0, 0] > 0.45).all()
    assert (np.abs(world.state.puck[:, 0, 0]) < 0.1).all()
    angle = np.arctan2(*world.state.puck_velocity[:, 0].T[::-1])
    assert (np.abs(angle) <= 0.3).all()
    assert len(np.unique(angle)) == 4


def test_holding_the_puck_in_a_duel_is_a_foul_and_a_dead_puck_is_served(backend):
    world = ah.make_world("duel", 2, backend=backend)
    world.reset(0)
    place_puck(world, -0.3, 0.15)
    steps = idle(world, 4.95)
    np.testing.assert_allclose(world.state.puck[:, 0], [[-0.3, 0.15]] * 2, atol=1e-6)
    held = world.observer.layout.labels.index("own_held")
    np.testing.assert_allclose(steps[-1].observation[:, :, held], [[4.95, 0.0]] * 2)
    last = idle(world, 0.05)[0]
    assert not last.reward.any()
    np.testing.assert_allclose(world.state.puck[:, 0], 0.0)
    assert (world.state.puck_velocity[:, 0, 0] > 0.45).all()
    robots = ah.make_world("duel", 2, backend=backend, seats="robot")
    robots.reset(0)
    place_puck(robots, 0.05, 0.2)
    idle(robots, 0.95)
    np.testing.assert_allclose(robots.state.puck[:, 0], [[0.05, 0.2]] * 2, atol=1e-6)
    idle(robots, 0.05)
    np.testing.assert_allclose(robots.state.puck[:, 0], 0.0)


def test_a_duel_ends_at_seven_goals_and_the_better_has_won(backend):
    world = ah.make_world("duel", 2, backend=backend, options={"goals_to_win": 2})
    world.autoreset = False
    world.reset(0)
    for _ in range(2):
        place_puck(world, -0.78, 0.0, -2.0)
        steps = idle(world, 0.1)
    assert any(s.terminated.all() for s in steps)
    assert world.episode.success.tolist() == [[False, True]] * 2
    assert world.episode.returns.tolist() == [[-2.0, 2.0]] * 2
    assert world.memory["goals"].tolist() == [[0.0, 2.0]] * 2
