"""The tutorial scripts run as their pages say."""

import re

import pytest
from tutorials import run

from marl_airhockey.data.exchange.formats import find_format
from marl_airhockey.data.record import record_episodes
from marl_airhockey.registry import make_driver


@pytest.mark.slow
def test_supersuit_shares_one_policy():
    out = run("tutorials/with_supersuit.py", "--steps", "20000", "--games", "20")
    assert "a game against itself: {'paddle_0': " in out
    assert 0 <= float(re.search(r"score against random: ([\d.]+)", out)[1]) <= 1


@pytest.mark.slow
def test_the_first_hour_makes_what_it_says(tmp_path):
    out = run("tutorials/first_hour.py", "--out", str(tmp_path / "tour"))
    assert {path.name for path in (tmp_path / "tour").iterdir()} == {
        *("touch", "recording", "touch.gif")
    }
    assert float(re.search(r"numba: success ([\d.]+)", out)[1]) > 0.9
    assert float(re.search(r"zoo/juggle +success ([\d.]+)", out)[1]) > 0.9


@pytest.mark.slow
def test_mappo_in_one_file_learns_to_rally():
    out = run("tutorials/mappo.py", "--updates", "60")
    rewards = [float(x) for x in re.findall(r"reward of a step (-?[\d.]+)", out)]
    assert rewards[-1] > 1.5 * rewards[0] > 0.0
    assert float(re.search(r"return ([\d.]+), success", out)[1]) > 6.0


@pytest.mark.slow
def test_torchrl_trains_with_the_state():
    out = run("tutorials/with_torchrl.py", "--updates", "2", "--frames", "1000")
    assert out.count("crossings per episode") == 2


@pytest.mark.slow
def test_recurrent_and_hindsight_policies_of_sb3_contrib_learn():
    out = run("tutorials/with_sb3_contrib.py", "--steps", "4000")
    assert out.count(", standard deviation ") == 2


def recorded(path, task):
    agent = make_driver(f"zoo/{task}")
    return record_episodes(agent, task, task, 60, path / task, 0, {})


@pytest.mark.slow
def test_torchrl_learns_from_a_minari_dataset_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    find_format("minari").export(
        [recorded(tmp_path, "reach")], "airhockey/reach/test-v0", None, 0
    )
    words = "tutorials/with_minari.py", "airhockey/reach/test-v0"
    errors = [
        float(re.search(r"error of the action ([\d.]+)", run(*words, "--steps", n))[1])
        for n in ("4", "400")
    ]
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize(
    ("form", "script", "words"),
    [
        ("lerobot", "with_lerobot_files.py", "60 episodes, "),
        ("hdf5", "with_h5py.py", "60 trajectories, "),
    ],
)
def test_exported_files_are_read_without_us(tmp_path, form, script, words):
    files = [recorded(tmp_path, "touch")]
    folder = find_format(form).export(files, "set", tmp_path, 0)
    assert words in run(f"tutorials/{script}", str(folder))
