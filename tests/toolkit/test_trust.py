"""Files of policies: no code of theirs runs unasked, none takes all the memory."""

import json
import os
import zipfile

import numpy as np
import pytest
from stable_baselines3 import PPO

import marl_airhockey as ah
from marl_airhockey.registry import make_agent
from marl_airhockey.toolkit.numpy_policy import NumpyPolicy
from marl_airhockey.toolkit.policies import load_policy
from marl_airhockey.toolkit.trust import Trust


class Trap:
    """Object that makes a folder when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (os.makedirs, (str(self.path), 0o777, True))


@pytest.fixture
def trap(tmp_path):
    """Path of a zip of SB3's, and of the folder that its code makes."""
    env = ah.make_sb3_vec("reach", 2)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=16)
    model.surprise = Trap(tmp_path / "sprung")
    model.save(tmp_path / "model.zip")
    return tmp_path / "model.zip", tmp_path / "sprung"


def test_a_zip_with_code_is_refused_before_it_runs(trap, monkeypatch):
    path, sprung = trap
    for load in (
        load_policy,
        make_agent,
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


def test_a_run_is_played_from_its_weights_alone(touch_run, tmp_path):
    assert {path.name for path in touch_run.iterdir()} >= {"best.npz", "last.npz"}
    seen = np.random.default_rng(0).normal(size=(5, 12)).astype(np.float32)
    whole = PPO.load(touch_run / "last.zip", device="cpu")
    mean = np.clip(whole.predict(seen, deterministic=True)[0], -1, 1)
    for name in ("last.npz", "last.zip"):
        policy = load_policy(touch_run / name)
        np.testing.assert_allclose(
            np.clip(policy.predict(seen, True), -1, 1), mean, atol=1e-5
        )
    # Pickles in a zip of our training are not looked at.
    with zipfile.ZipFile(touch_run / "last.zip") as old:
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
    with pytest.raises(ValueError, match=r"no policy of ours: .*800,000,000,000 bytes"):
        NumpyPolicy.load(tmp_path / "big.npz")
