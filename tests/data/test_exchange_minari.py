"""Recordings as Minari datasets, which are loaded without this library, and back."""

import os
import subprocess
import sys

import numpy as np
import pytest

from marl_airhockey.data.benchmark.content import reference_returns
from marl_airhockey.data.exchange.minari import export_minari, import_minari
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.registry import make_driver

minari = pytest.importorskip("minari")
NAME = "airhockey/reach/test-v0"


@pytest.fixture(autouse=True)
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    return tmp_path / "sets"


def recorded(folder, scenario="reach", driver="reacher", episodes=3, **keywords):
    agent = make_driver(driver)
    path = folder / "recording"
    return record_episodes(agent, driver, scenario, episodes, path, 0, keywords)


def test_a_dataset_holds_the_recording(tmp_path, root):
    path = recorded(tmp_path)
    assert export_minari([path], NAME) == root / NAME
    dataset = minari.load_dataset(NAME)
    recording = read_recording(path)
    assert dataset.total_episodes == len(recording.episodes)
    assert dataset.env_spec.kwargs["scenario"] == "reach"
    for own, other in zip(recording.episodes, dataset.iterate_episodes(), strict=True):
        shown = np.concatenate(
            [own.first["observation"][None], own.columns["observation"]]
        )
        assert np.array_equal(other.observations, shown[:, 0])
        assert np.array_equal(other.actions, own.columns["action"][:, 0].astype("f4"))
        assert np.allclose(other.rewards, own.columns["reward"][:, 0])
        assert other.terminations[-1] or other.truncations[-1]
        positions = other.infos["state"]["position"]
        assert np.array_equal(positions[1:], own.columns["state.position"])
        assert dataset.observation_space.contains(other.observations[0])
    env = dataset.recover_environment()
    assert env.reset(seed=0)[0].shape == other.observations[0].shape
    env.close()


def test_it_is_loaded_by_minari_alone(tmp_path, root):
    export_minari([recorded(tmp_path)], NAME)
    code = (
        "import sys; sys.modules['marl_airhockey'] = None\n"
        f"import minari; d = minari.load_dataset({NAME!r})\n"
        "e = d[0]; assert len(e.observations) == len(e.actions) + 1\n"
        "print(d.total_steps, d.observation_space.shape)"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        capture_output=True,
        text=True,
        env=os.environ,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[0]) > 0


def test_it_comes_back_as_it_went(tmp_path):
    path = recorded(tmp_path / "first")
    export_minari([path], NAME)
    again = import_minari(ImportSettings(NAME, "reach", tmp_path / "second"))
    before, after = read_recording(path), read_recording(again)
    for name in ("scenario", "options", "profile", "observe", "control_dt"):
        assert after.head[name] == before.head[name]
    for one, two in zip(before.episodes, after.episodes, strict=True):
        for name in ("observation", "reward", "success", "terminated", "truncated"):
            assert np.array_equal(one.columns[name], two.columns[name]), name


def test_a_game_is_exported_by_agent_or_by_seat(tmp_path):
    path = recorded(tmp_path, "duel", "allround", 1, drivers={"paddle_1": "still"})
    export_minari([path], "airhockey/duel/joint-v0", seat=None)
    export_minari([path], "airhockey/duel/second-v0", seat=1)
    joint = minari.load_dataset("airhockey/duel/joint-v0")[0]
    assert list(joint.observations) == ["paddle_0", "paddle_1"]
    second = minari.load_dataset("airhockey/duel/second-v0")[0]
    assert np.array_equal(second.observations, joint.observations["paddle_1"])
    assert np.allclose(second.rewards, joint.infos["reward"][1:, 1])


def test_goals_stay_apart(tmp_path):
    path = recorded(tmp_path, goals="dict")
    export_minari([path], NAME)
    dataset = minari.load_dataset(NAME)
    assert set(dataset[0].observations) == {
        "observation",
        "achieved_goal",
        "desired_goal",
    }


def test_what_cannot_be_is_named_and_leaves_nothing(tmp_path, root):
    path = recorded(tmp_path)
    with pytest.raises(ValueError, match="expected a name such as"):
        export_minari([path], "no version")
    with pytest.raises(ValueError, match="--seat 4"):
        export_minari([path], NAME, seat=4)
    assert not (root / NAME).exists()
    export_minari([path], NAME)
    with pytest.raises(ValueError, match="give a new version"):
        export_minari([path], NAME)
    with pytest.raises(ValueError, match="this Minari dataset does not exist"):
        import_minari(
            ImportSettings("airhockey/none/none-v0", "reach", tmp_path / "other")
        )
    with pytest.raises(ValueError, match="observations have the shape"):
        import_minari(ImportSettings(NAME, "juggle", tmp_path / "other"))
    assert not list(root.glob(".part*"))


def test_normalized_scores_are_those_of_the_named_datasets(tmp_path):
    export_minari([recorded(tmp_path)], NAME)
    dataset = minari.load_dataset(NAME)
    low, high = reference_returns("reach")
    score = minari.get_normalized_score(dataset, np.array([low, high]))
    assert np.allclose(score, [0.0, 1.0])
    other = recorded(tmp_path / "other", profile="ur5e")
    export_minari([other], "airhockey/reach/other-v0")
    assert (
        minari.load_dataset("airhockey/reach/other-v0").storage.metadata.get(
            "ref_min_score"
        )
        is None
    )
