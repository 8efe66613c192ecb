"""TorchRL's environment: its specs hold, and it plays what PettingZoo's plays."""

import numpy as np
import pytest
import torch
from torchrl.envs import check_env_specs

import marl_airhockey as ah


def actions_of(env, rng):
    """Return random actions as TorchRL takes them, and as (B, agents, 2)."""
    worlds, agents = env.world.num_worlds, len(env.world.open)
    array = rng.uniform(-1, 1, (worlds, agents, 2)).astype(np.float32)
    step = env.action_spec.zero()
    first = 0
    for group, names in env.group_map.items():
        last = first + len(names)
        step[group, "action"] = torch.as_tensor(array[:, first:last])
        first = last
    return step, array


def test_every_scenario_keeps_its_specs(scenario):
    env = ah.make_torchrl(scenario, 3, max_cycles=20)
    env.set_seed(0)
    check_env_specs(env)
    env.close()


@pytest.mark.parametrize("game", ["juggle", "doubles", "free_for_all"])
def test_rows_are_those_of_pettingzoo(game):
    many, one = ah.make_torchrl(game, 2, max_cycles=30), ah.parallel_env(game)
    one.max_cycles = 30
    many.set_seed(4)
    seen = many.reset()
    first, _ = one.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(30):
        for group, agents in many.group_map.items():
            for place, agent in enumerate(agents):
                row = seen[group, "observation"][1, place].numpy()
                np.testing.assert_array_equal(row, first[agent])
        np.testing.assert_array_equal(seen["state"][1].numpy(), one.state())
        step, array = actions_of(many, rng)
        seen = many.step(step)["next"]
        moves = dict(zip(one.agents, array[1], strict=True))
        first, paid, ended, late, _ = one.step(moves)
        for group, agents in many.group_map.items():
            reward = seen[group, "reward"][1, :, 0].tolist()
            assert reward == pytest.approx([paid[agent] for agent in agents])
        assert bool(seen["terminated"][1]) == all(ended.values())
        assert bool(seen["truncated"][1]) == all(late.values())
        if not one.agents:
            break
    assert bool(seen["done"][1])


def test_worlds_begin_anew_by_themselves_while_others_go_on():
    env = ah.make_torchrl("touch", 4, max_cycles=10)
    env.set_seed(0)
    env.reset()
    way = env.rollout(25, auto_reset=True, break_when_any_done=False)
    time_share = way["state"][..., env.state_labels.index("time_share")]
    begun = way["next", "done"][:, :-1, 0]
    assert begun.any()
    assert (time_share[:, 1:][begun] == 0.0).all()
    assert (time_share[:, 1:][~begun] > 0.0).all()


def test_the_same_seed_gives_the_same_games():
    ways = []
    for _ in range(2):
        env = ah.make_torchrl("rally", 3, max_cycles=15)
        env.set_seed(7)
        torch.manual_seed(0)
        ways.append(env.rollout(15))
    assert (ways[0] == ways[1]).all()


def test_what_is_not_flat_is_refused():
    with pytest.raises(ValueError, match="flat numbers"):
        ah.make_torchrl("hit_goal", 2, goals="dict")
    with pytest.raises(ValueError, match="flat numbers"):
        ah.make_torchrl("reach", 2, observe="pixels")
