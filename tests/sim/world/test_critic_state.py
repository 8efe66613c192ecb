"""Critic state of a batch: equal to that of single environments."""

import numpy as np
import pytest

import marl_airhockey as ah


@pytest.mark.parametrize("game", ah.scenario_names())
def test_the_critic_state_of_a_batch_is_that_of_single_environments(game):
    world, one = ah.make_world(game, 3, max_cycles=6), ah.parallel_env(game)
    one.max_cycles = 6
    seen = world.reset(seed=4)
    one.reset(seed=5)
    assert world.critic_state_labels == one.state_labels
    assert world.critic_state_space == one.state_space
    assert world.observation_space == one.observation_space(one.possible_agents[0])
    assert world.action_space == one.action_space(one.possible_agents[0])
    rng = np.random.default_rng(0)
    for _ in range(5):
        state = world.critic_state()
        assert state.dtype == np.float32
        assert all(world.critic_state_space.contains(row) for row in state)
        assert all(world.observation_space.contains(x) for x in seen[0])
        np.testing.assert_array_equal(state[1], one.state())
        actions = rng.uniform(-1, 1, (3, len(world.open), 2)).astype(np.float32)
        seen = world.step(actions).observation
        one.step(dict(zip(one.agents, actions[1], strict=True)))
    state[:] = 0.0
    assert world.critic_state().any()
