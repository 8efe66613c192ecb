"""Open and driven seats as PettingZoo sees them."""

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
    assert env.group_map == {"team_1": ["paddle_1"]}
    vec = ah.make_vec(Pair(), 4, drivers={"paddle_0": "random"})
    seen, _ = vec.reset(seed=0)
    assert seen.shape == (4, len(env.observation_labels("paddle_1")))
    with pytest.raises(ValueError, match="needs exactly one"):
        ah.make_vec(Pair(), 4)
