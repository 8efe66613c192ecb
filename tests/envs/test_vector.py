"""Vector environments: ends of episodes, seeds, what SB3 needs."""

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

import marl_airhockey as ah
from marl_airhockey import discovery


def test_truncation_and_termination_through_sb3():
    venv = ah.make_sb3_vec("juggle", 64, max_cycles=45)
    venv.seed(0)
    venv.reset()
    cut = ended = 0
    for _ in range(120):
        seen, _, done, infos = venv.step(np.zeros((64, 2)))
        for i, info in enumerate(infos):
            assert ("episode" in info) == bool(done[i])
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


MAKERS = {
    "make": lambda **given: gymnasium.make(ID, **given),
    "entry point": lambda **given: gymnasium.make_vec(ID, 2, **given),
    "sync": lambda **given: gymnasium.make_vec(ID, 2, "sync", **given),
}
ID = "marl_airhockey/Juggle-v0"


def length_of(env):
    """Return the number of steps to the end of an episode in which nothing fails."""
    env.reset(seed=0)
    for k in range(1, 40):
        *_, cut, _ = env.step(np.zeros(env.action_space.shape, np.float32))
        if np.all(cut):
            return k
    return None


@pytest.mark.parametrize("kind", MAKERS)
def test_episodes_have_the_length_that_gymnasium_is_given(kind):
    env = MAKERS[kind](max_episode_steps=5)
    assert length_of(env) == 5
    assert length_of(MAKERS[kind](max_cycles=7)) == 7
    assert length_of(MAKERS[kind](max_cycles=7, max_episode_steps=9)) == 7
    if kind != "sync":
        assert env.spec.max_episode_steps == 5
        assert MAKERS[kind]().spec.max_episode_steps == 300
        longer = MAKERS[kind](max_cycles=500)
        assert longer.spec.max_episode_steps == 500
        longer.unwrapped.max_cycles = 20
        assert length_of(longer) == 20


@pytest.mark.parametrize("game", ah.scenario_names())
def test_specifications_hold_the_length_of_an_episode(game):
    one = {
        f"paddle_{i}": "still"
        for i in range(1, len(ah.make_scenario(game).scene.seats))
    }
    name = discovery.gymnasium_id(game)
    env = gymnasium.make(name, drivers=one)
    assert env.spec.max_episode_steps == env.unwrapped.max_cycles
    timed = gymnasium.wrappers.TimeAwareObservation(env, normalize_time=True)
    timed.reset(seed=0)
    seen = timed.step(env.action_space.sample())[0]
    assert seen[-1] == pytest.approx(1 / env.unwrapped.max_cycles)
    again = gymnasium.make(env.spec)
    assert again.spec.max_episode_steps == env.spec.max_episode_steps


def test_the_generator_of_a_vector_environment_follows_its_seed():
    envs, others = ah.make_vec("touch", 2), ah.make_vec("touch", 2)
    for seeds in (3, 3), (4, [4, 9]):
        for env, seed in zip((envs, others), seeds, strict=True):
            env.reset(seed=seed)
        assert envs.np_random.random() == others.np_random.random()
    assert envs.np_random_seed == 4


def test_success_has_the_name_that_learners_look_for():
    envs = ah.make_vec("touch", 64, autoreset_mode="SameStep")
    envs.action_space.seed(0)
    _, info = envs.reset(seed=0)
    met = 0
    for _ in range(130):
        assert info["is_success"].shape == (64,)
        *_, info = envs.step(envs.action_space.sample())
        final = info.get("final_info")
        np.testing.assert_array_equal(info["is_success"], info["success"])
        if final is not None:
            met += final["is_success"].sum()
    assert met


@pytest.mark.parametrize(
    "build",
    [ah.parallel_env, ah.gym_env, ah.make_vec],
)
def test_a_built_environment_refuses_what_only_building_sets(build):
    env = build("juggle")
    env.max_cycles = 8
    assert env.world.max_cycles == 8
    env.note = "mine"
    assert env.note == "mine"
    with pytest.raises(AttributeError, match="did you mean 'max_cycles'"):
        env.max_cycle = 7
    with pytest.raises(AttributeError, match="create one with profile="):
        env.profile = "ur5e"
    with pytest.raises(AttributeError, match="lift"):
        env.lift = 0.1
    with pytest.raises(ValueError, match="must be a whole number"):
        env.max_cycles = 2.5


def test_sb3_wrappers_seeds_and_saving(tmp_path):
    models = []
    for _ in range(2):
        venv = VecNormalize(ah.make_sb3_vec("touch", 8))
        model = PPO("MlpPolicy", venv, n_steps=16, batch_size=32, n_epochs=1, seed=0)
        models.append(model.learn(256))
    first, second = (next(m.policy.parameters()).detach().numpy() for m in models)
    np.testing.assert_array_equal(first, second)
    models[0].save(tmp_path / "model.zip")
    policy = ah.load_policy(tmp_path / "model.zip", trust=True)
    assert policy.shape == (12,)
