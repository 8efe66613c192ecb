"""Training, resuming, evaluating; policies of all kinds as drivers."""

import csv
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import onnx
import pytest
import torch
from stable_baselines3 import PPO, SAC

import marl_airhockey as ah
from marl_airhockey.evaluation.deployability import Deployability
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval
from marl_airhockey.learn.best_response import best_response
from marl_airhockey.learn.config import RUN_FORMAT, TrainConfig, load_config, preset
from marl_airhockey.learn.export import export_policy
from marl_airhockey.learn.train import train
from marl_airhockey.toolkit.policies import load_policy
from marl_airhockey.transfer.measure import fine_tuning_config

SMALL = {
    "total_steps": 16_384,
    "num_worlds": 32,
    "batch_size": 256,
    "evaluations": 2,
    "eval_episodes": 10,
}


def rows(folder):
    with (folder / "evaluations.csv").open() as file:
        return list(csv.DictReader(file))


def test_presets_are_whole_and_bad_settings_are_named(scenario):
    config = preset(scenario, {"seed": 3})
    assert config.total_steps > 0
    assert config.seed == 3
    with pytest.raises(ValueError, match="there are: gamma"):
        preset(scenario, {"gama": 0.9})
    with pytest.raises(ValueError, match="num_worlds"):
        preset(scenario, {"num_worlds": 0})
    with pytest.raises(ValueError, match="batch_size"):
        preset(scenario, {"num_worlds": 3})
    with pytest.raises(ValueError, match="learning_rate"):
        preset(scenario, {"learning_rate": "fast"})


def test_a_configuration_survives_its_file(tmp_path):
    changes = {"options": {"pucks": 2}, "profile": "robot", "hidden": [32]}
    config = preset("juggle", changes)
    assert config.observe == "history"
    path = tmp_path / "config.toml"
    path.write_text(config.to_toml())
    assert load_config(path) == config
    path.write_text("nothing = 1")
    with pytest.raises(ValueError, match="no training configuration"):
        load_config(path)


@pytest.mark.parametrize("found", [1, 99])
def test_a_run_of_another_format_is_refused(tmp_path, found):
    folder = tmp_path / "old"
    folder.mkdir()
    for name in ("last.zip", "state.json"):
        (folder / name).touch()
    first, _, settings = preset("duel", SMALL).to_toml().partition("\n")
    assert first == f"format = {RUN_FORMAT}"
    # The first runs had no number.
    number = "" if found == 1 else f"format = {found}\n"
    (folder / "config.toml").write_text(number + settings)
    fresh = preset("duel", {**SMALL, "init": str(folder)})
    for use in (
        lambda: train(None, folder),
        lambda: train(fresh, tmp_path / "fresh"),
        lambda: export_policy(folder, tmp_path / "policy.npz"),
        lambda: fine_tuning_config(folder, 64),
        lambda: best_response("duel", "still", 64, folder),
    ):
        with pytest.raises(ValueError, match=f"another version .*format {found}"):
            use()
    assert not (tmp_path / "policy.npz").exists()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "touch-0"
    seen = []
    train(
        preset("touch", {**SMALL, "total_steps": 98_304}),
        folder,
        lambda done, total, row: seen.append((done, total)),
    )
    assert seen[-1][0] <= seen[-1][1]
    return folder


def test_a_run_leaves_all_that_is_needed(run):
    names = {p.name for p in run.iterdir()}
    assert names >= {
        "config.toml",
        "versions.json",
        "progress.csv",
        "evaluations.csv",
        "best.zip",
        "last.zip",
        "state.json",
    }
    assert any("tfevents" in name for name in names)
    versions = json.loads((run / "versions.json").read_text())
    assert versions["torch"] == torch.__version__
    assert versions["git"]
    table = rows(run)
    assert int(table[-1]["steps"]) == 98_304
    with (run / "progress.csv").open() as file:
        header = file.readline()
    assert "reward/touch" in header
    assert "eval/success" in header


def test_it_learned_to_touch(run):
    learned = evaluate(load_policy(run), "learned", "touch", 200)
    still = evaluate(ah.make_agent("still"), "still", "touch", 200)
    assert learned.success > still.success + 0.3


def test_a_policy_plays_the_same_deterministically_and_samples_otherwise(run):
    mean = evaluate(load_policy(run), "mean", "touch", 40)
    again = evaluate(load_policy(run), "mean", "touch", 40)
    assert mean.returns == again.returns
    sampled = load_policy(run / "best.zip", deterministic=False)
    assert evaluate(sampled, "sampled", "touch", 40).returns != mean.returns


def test_a_policy_of_another_scenario_is_refused(run):
    with pytest.raises(ValueError, match="expects observations of shape"):
        evaluate(load_policy(run), "learned", "juggle", 2)


def test_a_finished_run_is_not_overwritten(run):
    with pytest.raises(ValueError, match="holds a run already"):
        train(preset("touch", SMALL), run)
    steps = rows(run)[-1]["steps"]
    assert int(train(None, run)["steps"]) == int(steps)


def test_a_killed_run_goes_on_where_it_stood(tmp_path):
    folder = tmp_path / "killed"
    command = [sys.executable, "-m", "marl_airhockey.cli", "train", "touch"]
    command += ["--out", str(folder), "--steps", "200000", "--set", "num_worlds=32"]
    for setting in ("batch_size=256", "evaluations=25", "eval_episodes=5"):
        command += ["--set", setting]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    state = folder / "state.json"
    deadline = time.monotonic() + 120
    while not state.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    stood = json.loads(state.read_text())["steps"]
    assert 0 < stood < 200_000
    again = ["--resume", str(folder), "--json"]
    out = subprocess.run(
        [*command[:4], *again], capture_output=True, text=True, check=True
    )
    last = json.loads(out.stdout)
    assert last["steps"] >= 200_000
    steps = [int(row["steps"]) for row in rows(folder)]
    assert steps == sorted(steps)
    assert stood in steps


def test_any_sb3_zip_whose_spaces_fit_drives(tmp_path):
    env = ah.make_sb3_vec("reach", 2)
    for kind, extra in ((PPO, {"n_steps": 8, "batch_size": 16}), (SAC, {})):
        path = tmp_path / f"{kind.__name__}.zip"
        kind("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, **extra).save(path)
        result = evaluate(load_policy(path), kind.__name__, "reach", 5)
        assert result.episodes == 5


def onnx_policy(path, size, outputs):
    weight = np.full((size, outputs), 0.01, np.float32)
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["observation", "weight"], ["action"])],
        "policy",
        [helper.make_tensor_value_info("observation", kind, ["batch", size])],
        [helper.make_tensor_value_info("action", kind, ["batch", outputs])],
        [onnx.numpy_helper.from_array(weight, "weight")],
    )
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=9), path)


def test_an_onnx_policy_whose_spaces_fit_drives(tmp_path):
    onnx_policy(tmp_path / "good.onnx", 8, 2)
    driver = load_policy(tmp_path / "good.onnx")
    assert evaluate(driver, "onnx", "reach", 5).episodes == 5
    with pytest.raises(ValueError, match="expects observations"):
        evaluate(driver, "onnx", "touch", 2)
    onnx_policy(tmp_path / "wrong.onnx", 8, 3)
    with pytest.raises(ValueError, match="expected actions"):
        evaluate(load_policy(tmp_path / "wrong.onnx"), "onnx", "reach", 2)


def test_a_policy_can_sit_in_any_seat_by_its_path(run):
    world = ah.make_world("touch", 2, drivers={"paddle_0": str(run)})
    world.reset(0)
    world.step(np.zeros((2, 0, 2)))
    assert np.abs(world.command).max() > 0


def test_the_measures_of_a_match():
    low, high = interval(0.5, 200)
    assert 0.42 < low < 0.44
    assert 0.56 < high < 0.58
    assert interval(0.0, 100)[0] == 0.0
    calm = Deployability.of(0.0, 1.0, 0.05, 1.0, 0.05)
    assert calm.grade == "A"
    assert Deployability.of(0.0, 1.0, 0.3, 1.0, 0.05).grade == "C"
    assert Deployability.of(0.9, 1.0, 0.0, 1.0, 0.05).grade == "D"
    wild = evaluate(ah.make_agent("random"), "random", "reach", 50).deployability
    still = evaluate(ah.make_agent("still"), "still", "reach", 50).deployability
    assert still.violations_per_minute == 0
    assert still.grade == "A"
    assert wild.violations_per_minute > 600
    # White noise has half of its power in the upper half of the band.
    assert 0.4 < wild.power_above_5hz < 0.6


@pytest.mark.slow
@pytest.mark.parametrize(
    "task", ["reach", "touch", "strike", "juggle", "puck_velocity"]
)
def test_presets_learn_their_tasks(task, tmp_path):
    config = preset(task)
    assert isinstance(config, TrainConfig)
    row = train(config, tmp_path / task)
    assert row["success"] >= 0.9
