"""Learning from recordings: the dataset, each algorithm, its losses and its files."""

import numpy as np
import pytest

pytest.importorskip("torch")


import marl_airhockey as ah
from marl_airhockey.data.files import recordings_in
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.export import export_policy
from marl_airhockey.learn.offline.config import ALGORITHMS, offline_config
from marl_airhockey.learn.offline.dataset import load_dataset
from marl_airhockey.learn.train import load_any_config, run_training
from marl_airhockey.registry import make_agent

SMALL = {"hidden": [64, 64], "total_steps": 1500, "evaluations": 3}


def record(folder, agent, scenario, episodes, **keywords):
    return record_episodes(
        make_agent(agent), agent, scenario, episodes, folder, 3, keywords
    )


@pytest.fixture(scope="module")
def expert(tmp_path_factory):
    """Recordings of the zoo's policy for reach, and of a random one."""
    folder = tmp_path_factory.mktemp("expert")
    return record(folder, "zoo/reach", "reach", 40)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mixed")
    record(folder / "expert", "zoo/reach", "reach", 20)
    record(folder / "random", "random", "reach", 20)
    return folder


def test_steps_of_the_dataset_are_those_of_the_recording(expert):
    episodes = read_recording(expert).episodes
    size = episodes[0].columns["observation"].shape[-1]
    data = load_dataset([expert], 0, 1.0, 0.99, size)
    assert len(data) == sum(len(episode) for episode in episodes)
    by_return = sorted(episodes, key=lambda e: -e.columns["reward"].sum())
    first = by_return[0]
    steps = len(first)
    np.testing.assert_array_equal(
        data.steps.observation[0], first.first["observation"][0]
    )
    np.testing.assert_array_equal(
        data.steps.next_observation[:steps], first.columns["observation"][:, 0]
    )
    np.testing.assert_array_equal(
        data.steps.observation[1:steps], data.steps.next_observation[: steps - 1]
    )
    np.testing.assert_allclose(
        data.steps.reward[:steps] * data.reward_scale,
        first.columns["reward"][:, 0],
        rtol=1e-5,
        atol=1e-7,
    )
    np.testing.assert_array_equal(
        data.steps.next_action[: steps - 1], data.steps.action[1:steps]
    )
    assert abs(float(data.steps.action.abs().max())) <= 1.0


def test_only_a_termination_ends_what_lies_ahead(tmp_path):
    path = record(tmp_path, "random", "juggle", 20)
    ended = [e.columns["terminated"][-1] for e in read_recording(path).episodes]
    assert any(ended)
    size = read_recording(path).episodes[0].columns["observation"].shape[-1]
    data = load_dataset([path], 0, 1.0, 0.99, size)
    assert int((data.steps.not_done == 0).sum()) == sum(ended)


def test_a_share_is_that_of_the_best_episodes(mixed):
    files = recordings_in([mixed])
    config = offline_config("bc", [mixed], {})
    size = read_recording(files[0]).episodes[0].columns["observation"].shape[-1]
    whole = load_dataset(files, 0, 1.0, 0.99, size)
    best = load_dataset(files, 0, 0.25, 0.99, size)
    assert len(best) < len(whole) / 2
    mean = best.steps.reward.mean() * best.reward_scale
    assert mean > 1.5 * whole.steps.reward.mean() * whole.reward_scale
    assert config.data == [str(path) for path in files]


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_what_an_expert_did_is_learned(algo, expert, tmp_path):
    more = {"td3_bc": 6000, "rebrac": 6000}
    steps = more.get(algo, SMALL["total_steps"])
    config = offline_config(algo, [expert], SMALL | {"total_steps": steps})
    assert config.scenario == "reach"
    row = run_training(config, tmp_path / "run")
    assert row["success"] >= 0.9
    assert row["steps"] == steps
    assert load_any_config(tmp_path / "run") == config
    driver = ah.make_agent(tmp_path / "run")
    assert evaluate(driver, "reach", episodes=50).success >= 0.9


def test_a_run_that_was_cut_off_goes_on(expert, tmp_path):
    config = offline_config("iql", [expert], SMALL)
    calls = []

    def stop(done, total, row):
        calls.append(done)
        if len(calls) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_training(config, tmp_path, stop)
    begun = len((tmp_path / "evaluations.csv").read_text().splitlines())
    row = run_training(None, tmp_path)
    assert row["steps"] == SMALL["total_steps"]
    assert len((tmp_path / "evaluations.csv").read_text().splitlines()) > begun
    assert run_training(None, tmp_path) == row, "there is nothing left to do"
    card = export_policy(tmp_path, tmp_path / "reach.npz").card
    given = f"airhockey train reach --seed 0 --algo iql --data {expert.name} "
    assert card["command"].startswith(given)
    assert ah.load_policy(tmp_path / "reach.npz").trained_in["scenario"] == "reach"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"hidden": []}, "widths above 0"),
        ({"share": 0.0}, "share: 0.0 must be"),
        ({"expectile": 2.0}, "expectile: 2.0"),
        ({"scenario": "touch"}, "scenario: 'touch', but the recordings are of 'reach'"),
        ({"worlds": 3}, "worlds"),
        ({"seat": 4}, "there is no seat 4"),
    ],
)
def test_bad_settings_are_named(expert, tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        run_training(offline_config("bc", [expert], SMALL | change), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_data_that_does_not_fit_is_named(expert, tmp_path):
    with pytest.raises(ValueError, match="'cql'"):
        offline_config("cql", [expert], {})
    with pytest.raises(ValueError, match="no such file"):
        offline_config("bc", ["nowhere"], {})
    with pytest.raises(ValueError, match="there are no recordings"):
        offline_config("bc", [tmp_path], {})
    record(tmp_path, "still", "touch", 2)
    with pytest.raises(ValueError, match="scenario is 'touch', that of"):
        offline_config("bc", [expert, tmp_path], {})


@pytest.mark.parametrize("given", [{"options": {"goals": "dict"}}, {"goals": "dict"}])
def test_recordings_with_goals_apart_are_learned_from(tmp_path, given):
    apart = tmp_path / "goals"
    record(apart, "still", "hit_goal", 2, **given)
    run_training(offline_config("bc", [apart], SMALL), tmp_path / "run")
    policy = make_agent(tmp_path / "run")
    assert evaluate(policy, "hit_goal", episodes=2, goals="dict").episodes == 2


def test_recordings_of_pixels_are_cloned_from_pixels_alone(tmp_path):
    record(tmp_path, "still", "hit_goal", 2, observe="pixels")
    assert offline_config("bc", [tmp_path], {}).observe == "pixels"
    with pytest.raises(ValueError, match="bc alone"):
        offline_config("iql", [tmp_path], SMALL)
    size = ah.make_world("hit_goal", 1).observer.layout.centre.size
    with pytest.raises(ValueError, match="no observations"):
        load_dataset(recordings_in([tmp_path]), 0, 1.0, 0.99, size)
