"""Vector environments: ends of episodes, seeds, what SB3 needs."""

import os
import subprocess
import sys

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
    envs = ah.make_vec("touch", 16, max_cycles=30)
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
    policy = ah.load_policy(tmp_path / "model.zip")
    assert policy.shape == (11,)


def test_physics_ranges_are_drawn_anew_for_every_episode():
    world = ah.make_world(
        "touch", 32, physics={"puck_damping": (0.1, 0.9), "tilt": 4.0}
    )
    world.reset(0)
    first = world.episode.physics["puck_damping"].copy()
    assert ((first >= 0.1) & (first <= 0.9)).all()
    assert np.ptp(first) > 0.3
    assert (world.episode.physics["tilt"] == 4.0).all()
    world.reset()
    assert not np.array_equal(first, world.episode.physics["puck_damping"])
    world.reset(0)
    np.testing.assert_array_equal(first, world.episode.physics["puck_damping"])


def test_the_robot_profile_delays_and_blurs():
    sharp = ah.make_world("touch", 16, observe="velocity")
    blurred = ah.make_world("touch", 16, profile="robot", observe="velocity")
    assert ah.make_world("touch", profile="robot").observer.observe == "history"
    for world in (sharp, blurred):
        world.reset(0)
    labels = sharp.observer.layout.labels
    x = labels.index("puck_0.x")
    errors = []
    for _ in range(12):
        for world in (sharp, blurred):
            step = world.step(np.full((16, 1, 2), 0.5))
        errors.append(step.observation[:, 0, x] - blurred.state.puck[:, 0, 0])
    errors = np.array(errors)
    # 33 ms old: a falling puck is seen above where it is.
    assert 0.01 < np.median(errors) < 0.06
    assert (sharp.command[:, 0] != blurred.command[:, 0]).any()
    # One step of action delay: nothing moves in the first 50 ms.
    for world in (sharp, blurred):
        world.reset(0)
        world.step(np.full((16, 1, 2), 0.5))
    speed = np.linalg.norm(blurred.state.paddle_velocity[:, 0], axis=-1)
    full = np.linalg.norm(sharp.state.paddle_velocity[:, 0], axis=-1)
    assert (speed < 0.3 * full).all()


def test_occlusion_holds_what_was_seen():
    world = ah.make_world("touch", 64, physics={"occlusion": 0.3}, observe="history")
    world.reset(0)
    hidden = []
    for _ in range(30):
        world.step(np.zeros((64, 1, 2)))
        hidden.append(~world.sensed.visible[:, 0])
        held = world.sensor.history[hidden[-1], -1, 0, :2]
        before = world.sensor.history[hidden[-1], -2, 0, :2]
        np.testing.assert_array_equal(held, before)
    assert 0.2 < np.mean(hidden) < 0.4


def test_pixels_show_the_table_and_change():
    env = ah.make_vec("hit_goal", 3, observe="pixels")
    seen, _ = env.reset(seed=0)
    assert seen.shape == (3, 84, 84, 3)
    assert seen.dtype == np.uint8
    for _ in range(4):
        later = env.step(np.ones((3, 2)))[0]
    assert not np.array_equal(seen, later)
    assert not np.array_equal(later[..., 0], later[..., 2])
    assert env.observation_space.contains(later)


def test_threads_do_not_change_a_number():
    program = (
        "import hashlib, numpy as np, marl_airhockey as ah\n"
        "w = ah.make_world('juggle', 4096, backend='numba')\n"
        "seen, rng = [w.reset(0)], np.random.default_rng(0)\n"
        "for _ in range(30):\n"
        "    step = w.step(rng.uniform(-1, 1, (4096, 1, 2)))\n"
        "    seen += [step.observation, step.reward]\n"
        "print(hashlib.sha256(b''.join(s.tobytes() for s in seen)).hexdigest())\n"
    )
    runs = {
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"MARL_AIRHOCKEY_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(runs) == 1
    refused = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"MARL_AIRHOCKEY_THREADS": "many"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "MARL_AIRHOCKEY_THREADS: 'many'" in refused.stderr
