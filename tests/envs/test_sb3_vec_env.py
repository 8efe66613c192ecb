"""`make_sb3_vec` against a DummyVecEnv of single environments, side by side."""

import warnings

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecCheckNan, VecNormalize

import marl_airhockey as ah

SLOTS = 3
GAMES = [
    ("touch", {"max_cycles": 9}),
    ("puck_velocity", {}),
    ("juggle", {"profile": "ur5e", "max_cycles": 30}),
    ("reach", {"goals": "dict", "max_cycles": 7}),
]


def singles(name, wrap=lambda env: env, **keywords):
    """Return a DummyVecEnv of single environments."""
    return DummyVecEnv([lambda: wrap(ah.gym_env(name, **keywords))] * SLOTS)


def pair(name="juggle", wrap=lambda env: env, **keywords):
    """Return our environment and the one that it must equal."""
    ours = ah.make_sb3_vec(name, SLOTS, **keywords)
    return ours, singles(name, wrap, **keywords)


def assert_same(first, second):
    """Hold that two observations, or two lists of values, are equal to the bit."""
    np.testing.assert_equal(first, second)


def play(env, steps, seed=0):
    """Return what steps with the same random actions return, with copies of infos."""
    rng, played = np.random.default_rng(seed), []
    for _ in range(steps):
        actions = rng.uniform(-1, 1, (SLOTS, 2)).astype(np.float32)
        played.append(env.step(actions))
    return played


@pytest.mark.parametrize(("name", "keywords"), GAMES)
def test_steps_are_those_of_single_environments(name, keywords):
    ours, theirs = pair(name, Monitor, **keywords)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.seed(5) == theirs.seed(5) == [5, 6, 7]
    assert_same(ours.reset(), theirs.reset())
    ended = 0
    for mine, other in zip(play(ours, 120), play(theirs, 120), strict=True):
        for part, expected in zip(mine[:3], other[:3], strict=True):
            assert_same(part, expected)
        assert mine[1].dtype == other[1].dtype
        for info, more in zip(mine[3], other[3], strict=True):
            assert {"TimeLimit.truncated"} <= info.keys() <= more.keys() | {"episode"}
            for key in info.keys() - {"episode"}:
                assert_same(info[key], more[key])
            assert ("episode" in info) == ("episode" in more)
            if "episode" in info:
                ended += 1
                assert info["episode"]["l"] == more["episode"]["l"]
                # A Monitor rounds to six digits.
                assert info["episode"]["r"] == pytest.approx(more["episode"]["r"], 1e-4)
    assert ended > SLOTS


def test_an_info_is_a_dict_of_its_own():
    env = ah.make_sb3_vec("touch", SLOTS, max_cycles=3)
    env.seed(0)
    env.reset()
    for _ in range(5):
        infos = env.step(np.zeros((SLOTS, 2)))[3]
        assert all("mine" not in info for info in infos)
        for k, info in enumerate(infos):
            info["mine"] = k
        assert [info["mine"] for info in infos] == [0, 1, 2]


def test_seeds_are_used_by_one_reset():
    ours, theirs = pair("touch", max_cycles=4)
    drawn = []
    for env in ours, theirs:
        # The generator from which the library draws seeds.
        np.random.seed(3)  # noqa: NPY002
        drawn.append(env.seed())
    assert drawn[0] == drawn[1]
    for _ in range(3):
        assert_same(ours.reset(), theirs.reset())
    # A seed waits for its reset, also while episodes end by themselves.
    for env in ours, theirs:
        env.seed(8)
    for mine, other in zip(play(ours, 9), play(theirs, 9), strict=True):
        assert_same(mine[0], other[0])
    assert_same(ours.reset(), theirs.reset())


def test_options_are_used_by_one_reset():
    ours, theirs = pair("juggle")
    single = ah.gym_env("juggle")
    single.reset(seed=70)
    for _ in range(3):
        single.step(np.ones(2, np.float32))
    state, memory = single.get_state()
    every = {"state": state, "memory": memory}
    for options in every, [{}, every, {"state": state}]:
        for env in ours, theirs:
            env.seed(1)
            env.set_options(options)
        first = ours.reset()
        assert_same(first, theirs.reset())
        assert not np.array_equal(first, ours.reset())
        theirs.reset()
    for env in ours, theirs:
        env.set_options({"stat": state})
        with pytest.raises(ValueError, match="unknown reset option 'stat'"):
            env.reset()


def test_slots_of_one_world_begin_with_the_same_options():
    duel = ah.make_sb3_vec("duel", 2)
    assert duel.seed(5) == [5, 5, 6, 6]
    duel.reset()
    state, _ = duel.get_state()
    options = [{"state": state.map(lambda x: x[0])}, {}, {}, {}]
    duel.set_options(options)
    with pytest.raises(ValueError, match="slots of one world need equal"):
        duel.reset()
    duel.set_options([options[0], options[0], {}, {}])
    duel.reset()


def test_attributes_are_those_of_single_environments():
    ours, theirs = pair("juggle", physics={"puck_restitution": (0.5, 0.9)})
    for env in ours, theirs:
        env.seed(2)
        env.reset()
    for name in ("observation_labels", "physics", "max_cycles", "render_mode"):
        assert_same(ours.get_attr(name), theirs.get_attr(name))
        assert_same(ours.get_attr(name, [2, 0]), theirs.get_attr(name, [2, 0]))
        assert_same(ours.get_attr(name, 1), theirs.get_attr(name, 1))
    assert_same(ours.get_attr("action_space"), theirs.get_attr("action_space"))
    assert ours.get_attr("unwrapped")[0].max_cycles == 300
    for env in ours, theirs:
        assert env.has_attr("physics")
        assert not env.has_attr("phyics")
        with pytest.raises(AttributeError):
            env.get_attr("phyics")
        with pytest.raises(AttributeError):
            env.env_method("jump")
        assert env.env_is_wrapped(VecNormalize) == [False] * SLOTS


def test_what_is_set_has_its_effect_or_is_refused():
    ours, theirs = pair("juggle")
    for env in ours, theirs:
        env.seed(2)
        env.reset()
        env.set_attr("max_cycles", 4, [1, 2])
        env.set_attr("max_cycles", 6, 2)
        env.set_attr("note", "mine", 0)
        assert env.get_attr("max_cycles") == [300, 4, 6]
        assert env.get_attr("note", [0]) == ["mine"]
        with pytest.raises(ValueError, match="max_cycles: 0 must be a whole number"):
            env.set_attr("max_cycles", 0)
        with pytest.raises(AttributeError, match="did you mean 'max_cycles'"):
            env.set_attr("max_cycle", 7)
        with pytest.raises(AttributeError, match="create one with control_dt="):
            env.set_attr("control_dt", 0.1)
        with pytest.raises(AttributeError, match="lift"):
            env.set_attr("lift", 0.1)
        with pytest.raises(AttributeError, match="physics"):
            env.set_attr("physics", {})
    for mine, other in zip(play(ours, 9), play(theirs, 9), strict=True):
        for part, expected in zip(mine[:3], other[:3], strict=True):
            assert_same(part, expected)


def test_methods_are_those_of_single_environments():
    ours, theirs = pair("reach", goals="dict")
    for env in ours, theirs:
        env.seed(4)
        env.reset()
    play(ours, 2)
    play(theirs, 2)
    goals = ours.reset()["desired_goal"], theirs.reset()["desired_goal"]
    states = []
    for env, goal in zip((ours, theirs), goals, strict=True):
        (state, memory), *_ = env.env_method("get_state", indices=[1])
        seen = env.env_method("set_state", state, memory, indices=[0, 2])
        reward = env.env_method("compute_reward", goal, goal[::-1], {}, indices=0)
        states.append((memory, seen, reward, *(vars(state).values())))
    assert_same(*states)


def test_a_policy_is_evaluated_as_with_a_monitor():
    ours, theirs = pair("touch", Monitor, max_cycles=20)
    assert ours.env_is_wrapped(Monitor) == theirs.env_is_wrapped(Monitor)
    model = PPO("MlpPolicy", ours, n_steps=8, batch_size=8, seed=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = []
        for env in ours, theirs:
            env.seed(0)
            found.append(
                evaluate_policy(model, env, 6, return_episode_rewards=True)[:2]
            )
    np.testing.assert_allclose(*found, atol=1e-5)


def test_pictures_are_those_of_single_environments():
    ours, theirs = pair("juggle", render_mode="rgb_array")
    for env in ours, theirs:
        env.seed(4)
        env.reset()
    play(ours, 2)
    play(theirs, 2)
    assert_same(ours.get_images(), theirs.get_images())
    assert_same(ours.render(), theirs.render())
    assert_same(
        ours.env_method("render", indices=2), theirs.env_method("render", indices=2)
    )
    ours, theirs = pair("juggle")
    for env in ours, theirs:
        with pytest.warns(UserWarning, match="no `render_mode` was passed"):
            assert env.render() is None
        with pytest.warns(UserWarning, match="render.mode is None"):
            assert env.get_images() == [None] * SLOTS
        assert env.metadata["render_fps"] == 20


def test_wrappers_of_the_library_take_it():
    env = VecNormalize(VecCheckNan(ah.make_sb3_vec("touch", SLOTS)))
    assert env.seed(1) == [1, 2, 3]
    env.reset()
    env.step(np.zeros((SLOTS, 2), np.float32))
    env.close()
    env.close()
