"""Policies elsewhere than where they were trained."""

import json

import pytest

from marl_airhockey.cli.main import app
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.trust import Trust
from marl_airhockey.registry import make_driver
from marl_airhockey.system_id.measure import (
    fine_tuning_config,
    measure_transfer,
    plot_transfer,
)

SMALL = {
    "total_steps": 2048,
    "num_worlds": 32,
    "n_steps": 32,
    "batch_size": 512,
    "evaluations": 1,
    "eval_episodes": 20,
}


def test_success_is_measured_in_all_physics(tmp_path):
    pytest.importorskip("robosuite")
    backends = ["numba", "pymunk", "robosuite"]
    policies = {"zoo": make_driver("zoo/reach"), "nothing": make_driver("still")}
    rows = measure_transfer(policies, "reach", backends, ["ideal"], episodes=20)
    assert [row.backend for row in rows] == backends * 2
    assert min(row.success for row in rows[:3]) > 0.8
    assert max(row.success for row in rows[3:]) == 0.0
    assert json.dumps(rows[0].to_json())
    plot_transfer(rows, tmp_path / "transfer.png")
    assert (tmp_path / "transfer.png").stat().st_size > 1000


def test_training_begins_with_the_weights_of_a_run(tmp_path):
    easy = {**SMALL, "options": {"speed": 0.7, "hold": 0.05}}
    first = preset("reach", {**easy, "total_steps": 65_536})
    learned = run_training(first, tmp_path / "first")["success"]
    config = preset("reach", {**easy, "init": str(tmp_path / "first"), "seed": 1})
    again = run_training(config, tmp_path / "second")["success"]
    assert again >= learned - 0.3
    assert again > run_training(preset("reach", easy), tmp_path / "fresh")["success"]
    elsewhere = fine_tuning_config(tmp_path / "first", 4096)
    assert (elsewhere.backend, elsewhere.init) == ("robosuite", str(tmp_path / "first"))
    assert elsewhere.observe == first.observe
    wrong = preset(
        "reach", {**SMALL, "init": str(tmp_path / "first"), "hidden": [8, 8]}
    )
    with pytest.raises(ValueError, match="another size"):
        run_training(wrong, tmp_path / "wrong")
    with pytest.raises(ValueError, match="rllib cannot begin"):
        preset("reach", {**SMALL, "init": "x", "engine": "rllib"})
    lost = preset("reach", {**SMALL, "init": str(tmp_path / "nowhere")})
    with pytest.raises(ValueError, match="not the folder of a run"):
        run_training(lost, tmp_path / "lost")


def test_transfer_goes_on_with_what_was_cut_off(tmp_path, monkeypatch):
    """And looks at all that is asked before it trains anything."""
    out = str(tmp_path)
    ask = ["transfer", "reach", "--out", out, "--episodes", "5", "--to", "numba"]
    for wrong, words in (
        (["--profile", "real"], "unknown profile 'real'"),
        (["--to", "numba,mujoco"], "unknown backend 'mujoco'"),
        (["--policy", "still", "--fine-tune", "64"], "is a folder of a run"),
    ):
        with pytest.raises(ValueError, match=words):
            app([*ask, *wrong], standalone_mode=False)
    assert not list(tmp_path.iterdir())
    trained = []

    def train(config, folder):
        trained.append((folder.name, config is None))
        folder.mkdir(exist_ok=True)
        if config is not None:
            (folder / "config.toml").write_text(config.to_toml())
            (folder / "last.zip").touch()
        raise RuntimeError("cut off")

    monkeypatch.setattr("marl_airhockey.cli.transfer.train_with_progress", train)
    monkeypatch.setattr(Trust, "answer", None)
    with pytest.raises(RuntimeError, match="cut off"):
        app(ask, standalone_mode=False)
    with pytest.raises(ValueError, match="--trust"):
        app(ask, standalone_mode=False)
    with pytest.raises(ValueError, match="contains a run with other settings"):
        app([*ask, "--seed", "1"], standalone_mode=False)
    with pytest.raises(RuntimeError, match="cut off"):
        app([*ask, "--trust"], standalone_mode=False)
    assert trained == [("ideal", False), ("ideal", True)]
