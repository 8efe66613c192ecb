"""Files of policies: no code of theirs runs unasked, none takes all the memory."""

import json
import os
import zipfile

import numpy as np
import pytest
from stable_baselines3 import PPO

import marl_airhockey as ah
from marl_airhockey.evaluation.league import find_policies
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.learn.settings import load_config
from marl_airhockey.policies.load import load_policy
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.trust import Trust
from marl_airhockey.registry import make_driver


class Trap:
    """Object that makes a folder when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (os.makedirs, (str(self.path), 0o777, True))


@pytest.fixture
def trap(tmp_path, monkeypatch):
    """Path of a zip of SB3's, and of the folder that its code makes."""
    # A study that another test has opened says no for the whole process.
    monkeypatch.setattr(Trust, "answer", None)
    env = ah.make_sb3_vec("reach", 2)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=16)
    model.surprise = Trap(tmp_path / "sprung")
    model.save(tmp_path / "model.zip")
    return tmp_path / "model.zip", tmp_path / "sprung"


def test_a_zip_with_code_is_refused_before_it_runs(trap, monkeypatch):
    path, sprung = trap
    for load in (
        load_policy,
        make_driver,
        lambda p: ah.make_world("reach", 1, drivers={"paddle_0": str(p)}),
    ):
        with pytest.raises(ValueError, match=r"pickled Python.*--trust"):
            load(path)
    monkeypatch.setattr(Trust, "answer", False)
    with pytest.raises(ValueError, match="pickled Python"):
        load_policy(path)
    assert not sprung.exists()
    assert load_policy(path, trust=True).shape == (8,)
    assert sprung.exists()


def test_a_yes_to_all_files_or_at_a_terminal_loads_it(trap, monkeypatch, capsys):
    path, sprung = trap
    for stream in ("stdin", "stderr"):
        monkeypatch.setattr(f"sys.{stream}.isatty", lambda: True, raising=False)
    answers = iter(["\n", "yes\n"])
    monkeypatch.setattr("sys.stdin.readline", lambda: next(answers), raising=False)
    with pytest.raises(ValueError, match="pickled Python"):
        load_policy(path)
    assert not sprung.exists()
    assert load_policy(path).shape == (8,)
    assert "Do you trust" in capsys.readouterr().err
    monkeypatch.setattr(Trust, "answer", True)
    assert load_policy(path).shape == (8,)


def test_a_run_is_played_from_its_weights_alone(sb3_run, tmp_path):
    assert {path.name for path in sb3_run.iterdir()} >= {"best.npz", "last.npz"}
    seen = np.random.default_rng(0).normal(size=(5, 12)).astype(np.float32)
    whole = PPO.load(sb3_run / "last.zip", device="cpu")
    mean = np.clip(whole.predict(seen, deterministic=True)[0], -1, 1)
    for name in ("last.npz", "last.zip"):
        policy = load_policy(sb3_run / name)
        np.testing.assert_allclose(
            np.clip(policy.predict(seen, True), -1, 1), mean, atol=1e-5
        )
    # Pickles in a zip of our training are not looked at.
    with zipfile.ZipFile(sb3_run / "last.zip") as old:
        data = json.loads(old.read("data"))
        data["policy_class"][":serialized:"] = "no pickle"
        with zipfile.ZipFile(tmp_path / "last.zip", "w") as new:
            new.writestr("data", json.dumps(data))
            new.writestr("policy.pth", old.read("policy.pth"))
    assert load_policy(tmp_path / "last.zip").shape == (12,)


def test_arrays_are_counted_before_they_are_allocated(tmp_path):
    header = {"descr": "<f8", "fortran_order": False, "shape": (10**9, 100)}
    with (
        zipfile.ZipFile(tmp_path / "big.npz", "w") as archive,
        archive.open("weight_0.npy", "w") as file,
    ):
        np.lib.format.write_array_header_1_0(file, header)
    with pytest.raises(ValueError, match=r"is not a policy file: .*in 0 bytes"):
        NumpyPolicy.load(tmp_path / "big.npz")


def written(path, **changes):
    """Write a policy for reach with some arrays changed; None leaves one out."""
    rng = np.random.default_rng(0)
    arrays = {
        "weight_0": rng.normal(size=(2, 8)),
        "bias_0": np.zeros(2),
        "centre": np.zeros(8),
        "unit": np.ones(8),
        "log_std": np.zeros(2),
        "card": np.array(json.dumps({"observe": "velocity"})),
    }
    arrays |= changes
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return path


@pytest.mark.parametrize(
    "changes",
    [
        {"weight_0": None, "bias_0": None},
        {"bias_0": None},
        {"weight_0": np.zeros((3, 8)), "bias_0": np.zeros(3)},
        {"weight_0": np.zeros((2, 2, 8))},
        {"weight_0": np.zeros((2, 7))},
        {"weight_0": np.full((2, 8), np.nan)},
        {"weight_0": np.full((2, 8), "text")},
        {"unit": np.zeros(8)},
        {"unit": np.ones(5)},
        {"centre": np.array(0.0)},
        {"log_std": np.zeros(5)},
        {"log_std": np.zeros(2, complex)},
        {"card": np.array("[")},
        {"card": np.array("[" * 100_000)},
        {"card": np.array("[]")},
        {"card": np.array(json.dumps({"observe": ["x"]}))},
        {f"extra_{i}": np.zeros(1) for i in range(200)},
    ],
)
def test_what_is_no_policy_is_refused_when_it_is_read(changes, tmp_path):
    assert load_policy(written(tmp_path / "good.npz")).shape == (8,)
    with pytest.raises(ValueError, match="is not a policy file"):
        load_policy(written(tmp_path / "bad.npz", **changes))


def test_broken_and_disguised_arrays_are_refused(tmp_path):
    good = written(tmp_path / "good.npz").read_bytes()
    header = b"\x93NUMPY\x02\x00"
    for name, content in {
        "prefix": np.lib.format.magic(1, 0) + good,
        "cut": good[:-200],
        "flipped": good[:60] + b"????" + good[64:],
        "version": good.replace(b"\x93NUMPY\x01\x00", header, 1),
    }.items():
        path = tmp_path / f"{name}.npz"
        path.write_bytes(content)
        with pytest.raises(ValueError, match="is not a policy file"):
            load_policy(path)


def test_names_cannot_say_that_they_are_trusted(trap):
    path, sprung = trap
    for name in (f"{path}:trust=yes", f"zoo/juggle:path={path}", str(path)):
        with pytest.raises(ValueError, match=r"unknown|no such run|pickled Python"):
            make_driver(name)
    with pytest.raises(ValueError, match=r"unknown option .*'trust'"):
        make_driver(path, trust=True)
    assert not sprung.exists()


def test_a_file_is_a_file_whatever_its_name_looks_like(trap, tmp_path):
    path, sprung = trap
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "evil.py").write_text(f"open({str(sprung)!r}, 'w')")
    for name in ("evil.py:x.npz", f"still:path={path.name},trust=1,a=.npz"):
        written(folder / name)
    players = [make_driver(found) for found in find_policies(folder)]
    assert [player.shape for player in players] == [(8,), (8,)]
    assert not sprung.exists()


def test_a_run_of_somebody_else_runs_no_code_unasked(touch_run, tmp_path):
    evil, sprung = tmp_path / "evil.py", tmp_path / "sprung"
    evil.write_text(f"open({str(sprung)!r}, 'w')")
    text = (touch_run / "config.toml").read_text()
    for old, new in (
        ('scenario = "touch"', f'scenario = "{evil}"'),
        ("[drivers]", f'[drivers]\npaddle_1 = "{evil}:Evil:x=1"'),
    ):
        assert old in text
        (tmp_path / "config.toml").write_text(text.replace(old, new))
        with pytest.raises(ValueError, match="the name of Python code"):
            load_config(PPOConfig, tmp_path / "config.toml")
    assert not sprung.exists()
