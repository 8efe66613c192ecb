"""Pucks that are served again inside an episode."""

import numpy as np
from pair import Pair
from situations import idle

import marl_airhockey as ah


def test_the_game_goes_on_after_a_goal():
    world = ah.make_world(Pair(), 8, max_cycles=200)
    world.autoreset = False
    world.reset(1)
    goals, rng = np.zeros((8, 2)), np.random.default_rng(0)
    for _ in range(200):
        gap = world.state.puck - world.state.paddle
        gap[:, 1] *= -1
        before = world.state
        wild = rng.uniform(-1, 1, (8, 2, 2))
        step = world.step(np.where(rng.random((8, 2, 1)) < 0.5, 8 * gap, wild))
        goals += step.reward > 0
        served = world.state.time[:, None] * np.ones((1, 1))
        assert (served[:, 0] > before.time).all()
        np.testing.assert_allclose(step.reward.sum(-1), 0.0)
    np.testing.assert_array_equal(goals, world.memory["goals"])
    assert goals.sum() > 4
    assert step.truncated.all()
    assert not step.terminated.any()


def test_two_pucks_are_served_apart_and_both_count(backend):
    world = ah.make_world("duel", 4, backend=backend, options={"pucks": 2})
    world.reset(0)
    rows = world.state
    rows.puck[:], rows.puck_velocity[:] = (
        [(0.75, 0.06), (-0.75, 0.06)],
        [(2, 0), (-2, 0)],
    )
    world.set_state(rows, world.memory)
    idle(world, 0.2)
    assert (world.memory["goals"] == 1).all()
    gap = world.state.puck[:, 0] - world.state.puck[:, 1]
    assert (np.hypot(*gap.T) > 0.1).all()
    assert (world.state.puck_velocity[:, 0, 0] > 0.3).all()
    assert (world.state.puck_velocity[:, 1, 0] < -0.3).all()
