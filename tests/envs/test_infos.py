"""Infos, which clients of PettingZoo and gymnasium expect to be flat and alike."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import (
    NormalizeObservation,
    RecordEpisodeStatistics,
    RecordVideo,
)
from stable_baselines3.common.vec_env import VecVideoRecorder

import marl_airhockey as ah


def is_flat(info):
    kinds = (bool, float, np.bool_, np.number, np.ndarray)
    return all(isinstance(value, kinds) for value in info.values())


@pytest.mark.parametrize("game", ["juggle", "free_for_all"])
def test_infos_have_the_same_keys_at_reset_and_step(game):
    env = ah.parallel_env(game)
    _, first = env.reset(seed=0)
    actions = {agent: np.ones(2, np.float32) for agent in env.agents}
    _, reward, _, _, later = env.step(actions)
    for agent in env.possible_agents:
        assert first[agent].keys() == later[agent].keys()
        assert is_flat(first[agent])
        assert is_flat(later[agent])
        terms = [v for k, v in later[agent].items() if k.startswith("reward/")]
        assert sum(terms) == pytest.approx(reward[agent])
        assert first[agent]["cost"] == 0.0
        assert later[agent]["cost"] > 0.0
        assert later[agent]["constraint/acceleration"] > 0.0
        assert later[agent]["alive"]
    assert env.physics["tilt"] == env.world.episode.physics["tilt"][0]


def test_who_lost_all_lives_is_not_alive():
    env = ah.parallel_env("free_for_all")
    env.reset(seed=0)
    state, memory = env.get_state()
    memory["lives"][1] = 0.0
    env.set_state(state, memory)
    still = {agent: np.zeros(2, np.float32) for agent in env.agents}
    *_, infos = env.step(still)
    assert [infos[f"paddle_{i}"]["alive"] for i in range(4)] == [
        True,
        False,
        True,
        True,
    ]


def test_batches_tell_the_same_as_single_worlds():
    many, one = ah.make_vec("reach", 3), gymnasium.make("marl_airhockey/Reach-v1")
    _, first = many.reset(seed=5)
    assert first.keys() == one.reset(seed=5)[1].keys()
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 3, 2)).astype(np.float32)
    for action in actions:
        *_, infos = many.step(action)
        *_, info = one.step(action[0])
        assert is_flat(infos)
        for name, value in infos.items():
            np.testing.assert_allclose(value[0], info[name], err_msg=name)
    assert many.physics["tilt"].shape == (3,)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_batch_restarts_as_its_mode_says(mode):
    made = {"num_envs": 2, "max_cycles": 4, "autoreset_mode": mode.value}
    envs = gymnasium.make_vec(
        "marl_airhockey/Juggle-v0", vectorization_mode="vector_entry_point", **made
    )
    assert envs.metadata["autoreset_mode"] is envs.autoreset_mode is mode
    start, _ = envs.reset(seed=[7, 9])
    np.testing.assert_array_equal(start[1], ah.make_vec("juggle").reset(seed=9)[0][0])
    still = np.zeros((2, 2), np.float32)
    for _ in range(3):
        envs.step(still)
    seen, _, _, truncated, infos = envs.step(still)
    assert truncated.all()
    if mode is AutoresetMode.SAME_STEP:
        assert infos["_final_obs"].all()
        assert not np.array_equal(infos["final_obs"], seen)
    if mode is AutoresetMode.NEXT_STEP:
        again, reward, _, truncated, infos = envs.step(still)
        assert not np.array_equal(again, seen)
        assert not truncated.any()
        assert (reward == 0.0).all()
        assert (infos["cost"] == 0.0).all()
    if mode is AutoresetMode.DISABLED:
        with pytest.raises(RuntimeError, match="reset_mask"):
            envs.step(still)
        again, _ = envs.reset(options={"reset_mask": np.array([True, False])})
        assert not np.array_equal(again[0], seen[0])
        np.testing.assert_array_equal(again[1], seen[1])
        with pytest.raises(ValueError, match="reset_mask"):
            envs.reset(options={"reset_mask": [1, 0]})


def test_wrappers_of_gymnasium_run_on_batches():
    envs = ah.make_vec("juggle", 4, render_mode="rgb_array", max_cycles=8)
    envs = RecordEpisodeStatistics(NormalizeObservation(envs))
    envs.action_space.seed(0)
    envs.reset(seed=0)
    ends = 0
    for _ in range(40):
        *_, infos = envs.step(envs.action_space.sample())
        ends += int(infos.get("_episode", np.zeros(4, bool)).sum())
    assert ends >= 16
    pictures = envs.render()
    assert len(pictures) == 4
    assert all(picture.ndim == 3 and picture.std() > 0 for picture in pictures)
    with pytest.raises(RuntimeError, match="rgb_array"):
        ah.make_vec("juggle").render()
    with pytest.raises(ValueError, match="render_mode"):
        ah.make_vec("juggle", render_mode="human")


def test_an_unknown_keyword_is_an_error_in_the_words_of_python():
    for kind in (TypeError, ValueError):
        with pytest.raises(kind, match="unexpected keyword argument 'frameskip'"):
            gymnasium.make("marl_airhockey/Juggle-v0", frameskip=4)
    with pytest.raises(ValueError, match="did you mean 'max_cycles'"):
        ah.parallel_env("juggle", max_cycle=4)
    with pytest.raises(ValueError, match="autoreset_mode: 'never'"):
        ah.make_vec("juggle", autoreset_mode="never")
    with pytest.raises(ValueError, match="or one for each of 3"):
        ah.make_vec("juggle", 3).reset(seed=[1, 2])


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.filterwarnings("ignore")  # of its own
def test_torchrl_takes_every_scenario_as_it_is(scenario):
    pettingzoo = pytest.importorskip("torchrl.envs.libs.pettingzoo")
    utils = pytest.importorskip("torchrl.envs.utils")
    utils.check_env_specs(pettingzoo.PettingZooWrapper(ah.parallel_env(scenario)))


@pytest.mark.filterwarnings("ignore:.*Overwriting existing videos:UserWarning")
def test_batches_are_filmed_by_the_wrappers_of_others(tmp_path):
    many = ah.make_vec("reach", 4, render_mode="rgb_array", max_cycles=5)
    many = RecordVideo(many, str(tmp_path / "a"), episode_trigger=lambda k: k == 0)
    many.reset(seed=0)
    for _ in range(6):
        many.step(np.zeros((4, 2), np.float32))
    many.close()
    assert [path.suffix for path in (tmp_path / "a").iterdir()] == [".mp4"]
    slots = ah.make_sb3_vec("duel", 2, render_mode="rgb_array")
    folder = str(tmp_path / "b")
    slots = VecVideoRecorder(slots, folder, lambda step: step == 0, video_length=5)
    slots.reset()
    for _ in range(6):
        slots.step(np.zeros((4, 2), np.float32))
    slots.close()
    (film,) = (tmp_path / "b").iterdir()
    assert film.stat().st_size > 1000
