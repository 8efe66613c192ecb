"""Vector environments: ends of episodes, seeds, what SB3 needs."""

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import marl_airhockey as ah


def test_truncation_and_termination_through_sb3():
    venv = ah.make_sb3_vec("juggle", 64, max_cycles=45)
    venv.seed(0)
    venv.reset()
    cut = ended = 0
    for _ in range(120):
        seen, _, done, infos = venv.step(np.zeros((64, 2)))
        for i, info in enumerate(infos):
            assert bool(info) == bool(done[i])
            if not done[i]:
                continue
            last = info["terminal_observation"]
            assert last.shape == seen[i].shape
            assert not np.array_equal(last, seen[i])
            assert info["episode"]["l"] <= 45
            if info["TimeLimit.truncated"]:
                cut += 1
                assert info["episode"]["l"] == 45
            else:
                ended += 1
                # A dropped puck lies at home.
                assert last[4] < -0.7
    assert cut > 10
    assert ended > 10


def test_the_end_of_an_episode_is_that_of_a_world_that_does_not_restart():
    ends = {}
    world = ah.make_world("puck_velocity", 12)
    world.reset(5)
    for k in range(60):
        step = world.step(np.zeros((12, 1, 2)))
        for i in np.flatnonzero(step.terminated | step.truncated):
            ends.setdefault(int(i), (k, step.final_observation[i]))
    assert len(ends) > 3
    for i, (k, last) in ends.items():
        single = ah.parallel_env("puck_velocity")
        single.reset(seed=5 + i)
        for _ in range(k + 1):
            seen, _, ended, cut, _ = single.step({"paddle_0": np.zeros(2)})
        assert ended["paddle_0"] or cut["paddle_0"]
        np.testing.assert_array_equal(seen["paddle_0"], last[0])


def test_gymnasium_vector_environment_restarts_in_the_same_step():
    envs = ah.make_vec("touch", 16, autoreset_mode="SameStep", max_cycles=30)
    assert envs.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.SAME_STEP
    seen, _ = envs.reset(seed=1)
    assert seen.shape == (16, *envs.single_observation_space.shape)
    for _ in range(30):
        seen, reward, ended, cut, info = envs.step(envs.action_space.sample())
    assert (ended | cut).any()
    mask = info["_final_obs"]
    assert mask.any()
    assert not np.array_equal(info["final_obs"][mask], seen[mask])
    assert reward.shape == (16,)
    again = ah.make_vec("touch", 16)
    np.testing.assert_array_equal(again.reset(seed=1)[0], envs.reset(seed=1)[0])
    with pytest.raises(ValueError, match="seed"):
        envs.reset(seed=[1, 2])


def test_sb3_wrappers_seeds_and_saving(tmp_path):
    models = []
    for _ in range(2):
        venv = VecNormalize(VecMonitor(ah.make_sb3_vec("touch", 8)))
        model = PPO("MlpPolicy", venv, n_steps=16, batch_size=32, n_epochs=1, seed=0)
        models.append(model.learn(256))
    first, second = (next(m.policy.parameters()).detach().numpy() for m in models)
    np.testing.assert_array_equal(first, second)
    models[0].save(tmp_path / "model.zip")
    policy = ah.load_policy(tmp_path / "model.zip", trust=True)
    assert policy.shape == (12,)
