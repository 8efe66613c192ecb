"""Runs of training: what they leave, resuming, refusals."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import torch
from filelock import FileLock
from runs import SMALL, rows

import marl_airhockey as ah
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.best_response import best_response
from marl_airhockey.learn.export import export_policy
from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.policies.load import load_policy
from marl_airhockey.policies.runs import RUN_FORMAT
from marl_airhockey.system_id.measure import fine_tuning_config


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
        lambda: run_training(None, folder),
        lambda: run_training(fresh, tmp_path / "fresh"),
        lambda: export_policy(folder, tmp_path / "policy.npz"),
        lambda: fine_tuning_config(folder, 64),
        lambda: best_response("duel", "still", 64, folder),
    ):
        with pytest.raises(ValueError, match=f"another version .*format {found}"):
            use()
    assert not (tmp_path / "policy.npz").exists()


def test_a_run_leaves_all_that_is_needed(touch_run):
    names = {p.name for p in touch_run.iterdir()}
    assert names >= {
        "config.toml",
        "versions.json",
        "progress.csv",
        "evaluations.csv",
        "best.npz",
        "best.pt",
        "last.npz",
        "last.pt",
        "state.json",
    }
    assert any("tfevents" in name for name in names)
    versions = json.loads((touch_run / "versions.json").read_text())
    assert versions["torch"] == torch.__version__
    assert versions["marl_airhockey"]
    table = rows(touch_run)
    assert int(table[-1]["steps"]) == 98_304
    with (touch_run / "progress.csv").open() as file:
        header = file.readline()
    assert "reward/touch" in header
    assert "eval/success" in header


def test_it_learned_to_touch(touch_run):
    learned = evaluate(load_policy(touch_run), "touch", episodes=200)
    still = evaluate("still", "touch", episodes=200)
    assert learned.success > still.success + 0.3


def test_a_finished_run_is_not_overwritten(touch_run):
    with pytest.raises(ValueError, match="contains a run already"):
        run_training(preset("touch", SMALL), touch_run)
    steps = rows(touch_run)[-1]["steps"]
    assert int(run_training(None, touch_run)["steps"]) == int(steps)


def test_a_folder_with_other_things_is_refused_and_kept(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="contains other files: choose another"):
        ah.train("touch", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    "engine", ["torch", pytest.param("sb3", marks=pytest.mark.slow)]
)
def test_a_killed_run_goes_on_where_it_stood(engine, tmp_path):
    folder = tmp_path / "killed"
    command = [sys.executable, "-m", "marl_airhockey.cli", "train", "touch"]
    command += ["--out", str(folder), "--steps", "24000", "--set", "num_worlds=32"]
    command += ["--engine", engine]
    for setting in ("batch_size=256", "evaluations=8", "eval_episodes=2"):
        command += ["--set", setting]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    state = folder / "state.json"
    deadline = time.monotonic() + 120
    while not state.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    stood = json.loads(state.read_text())["steps"]
    assert 0 < stood < 24_000
    assert run_training(None, folder)["steps"] >= 24_000
    steps = [int(row["steps"]) for row in rows(folder)]
    assert steps == sorted(steps)
    assert stood in steps


@pytest.mark.slow
@pytest.mark.parametrize(
    "task", ["reach", "touch", "strike", "juggle", "puck_velocity"]
)
def test_presets_learn_their_tasks(task, tmp_path):
    config = preset(task)
    assert isinstance(config, PPOConfig)
    row = run_training(config, tmp_path / task)
    assert row["success"] >= 0.9


def test_a_run_that_fails_to_start_leaves_no_folder(tmp_path):
    folder = tmp_path / "runs" / "touch"
    with pytest.raises(ValueError, match="unknown driver"):
        ah.train("duel", folder, drivers={"paddle_1": "nobody"}, total_steps=1000)
    assert not folder.exists()
    with pytest.raises(ValueError, match="unknown driver"):
        ah.train("duel", folder, eval_opponents=["nobody"], total_steps=1000)
    assert not folder.exists()


def test_weights_of_a_torch_run_hold_no_code(touch_run, tmp_path):
    state = torch.load(touch_run / "last.pt", weights_only=True)
    assert set(state) == {"model", "optimizer"}
    fresh = preset("touch", {**SMALL, "init": str(touch_run)})
    row = run_training(fresh, tmp_path / "again")
    assert row["success"] > 0.5


@pytest.mark.parametrize("changes", [{"observe": "pixels"}, {"goals": "dict"}])
def test_pixels_and_goals_are_learned_by_sb3(changes):
    options = {"goals": changes["goals"]} if "goals" in changes else {}
    given = {k: v for k, v in changes.items() if k == "observe"}
    assert preset("reach", {**given, "options": options}).engine == "sb3"
    assert preset("reach").engine == "torch"
    with pytest.raises(ValueError, match="torch learns from flat observations"):
        preset("reach", {**given, "options": options, "engine": "torch"})


def test_self_play_from_images_is_named():
    with pytest.raises(ValueError, match="self-play does not learn from images"):
        preset("duel", {"observe": "pixels"})
    fixed = {"observe": "pixels", "drivers": {"paddle_1": "striker"}}
    assert preset("duel", fixed).engine == "sb3"


def test_ppo_from_images_leaves_a_policy_that_needs_no_trust(tmp_path):
    observe = "pixels:size=36,frames=2"
    tiny = {"total_steps": 256, "num_worlds": 4, "n_steps": 32, "batch_size": 64}
    rest = {"observe": observe, "n_epochs": 1, "evaluations": 1, "eval_episodes": 2}
    run_training(preset("touch", {**tiny, **rest}), tmp_path)
    policy = load_policy(tmp_path)
    assert (policy.observe, policy.shape) == (observe, (36, 36, 2))
    trusted = load_policy(tmp_path / "last.zip", trust=True)
    images = np.random.default_rng(0).integers(0, 256, (3, 36, 36, 2), np.uint8)
    found, expected = policy.predict(images, True), trusted.predict(images, True)
    np.testing.assert_allclose(found, np.clip(expected, -1, 1), atol=1e-4)


def test_all_cpu_time_is_counted_by_kind(tmp_path):
    began = time.process_time()
    run_training(preset("touch", SMALL), tmp_path / "run")
    spent = time.process_time() - began
    state = json.loads((tmp_path / "run/state.json").read_text())
    kinds = [f"{k}_cpu_seconds" for k in ("learning", "evaluation", "setup")]
    assert all(state[kind] > 0.0 for kind in kinds)
    assert state["cpu_seconds"] == pytest.approx(sum(state[kind] for kind in kinds))
    assert 0.8 * spent < state["cpu_seconds"] <= spent
    last = rows(tmp_path / "run")[-1]
    assert float(last["learning_cpu_seconds"]) == pytest.approx(state[kinds[0]])


def test_evaluations_of_a_game_are_a_share_of_its_training():
    def steps(config):
        return (
            config.evaluations
            * config.eval_episodes
            * len(config.eval_opponents)
            * 1200
        )

    short, whole = preset("duel", {"total_steps": 600_000}), preset("duel")
    assert short.evaluations == 1
    assert 0 < 1.5 * steps(short) <= 0.2 * short.total_steps
    assert whole.evaluations == 20
    assert 1.5 * steps(whole) <= 0.2 * whole.total_steps
    chosen = preset("duel", {"total_steps": 600_000, "evaluations": 5})
    assert (chosen.evaluations, preset("touch").evaluations) == (5, 20)


@pytest.fixture
def begun_run(tmp_path):
    """The folder of a run that was interrupted after its second evaluation."""

    def interrupt(done, total, row):
        if done > total / 2:
            raise KeyboardInterrupt

    steps = 2 * SMALL["total_steps"]
    config = preset("touch", {**SMALL, "total_steps": steps, "evaluations": 4})
    with pytest.raises(KeyboardInterrupt):
        run_training(config, tmp_path / "run", interrupt)
    return tmp_path / "run"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("state.json", "{", r"state.json is damaged \(Expecting property name"),
        ("state.json", "{}", "state.json is damaged"),
        ("state.json", None, r"state.json is damaged \(it is missing\)"),
        ("evaluations.csv", "steps\n", "evaluations.csv is damaged"),
        ("last.pt", "x", "last.pt: missing or damaged"),
        ("last.pt", None, "last.pt: missing or damaged"),
    ],
)
def test_a_damaged_run_is_not_resumed(begun_run, name, text, words):
    best = (begun_run / "best.npz").read_bytes()
    (begun_run / name).unlink()
    if text is not None:
        (begun_run / name).write_text(text)
    with pytest.raises(ValueError, match=words):
        run_training(None, begun_run)
    assert (begun_run / "best.npz").read_bytes() == best


def test_one_process_at_a_time_trains_in_a_folder(begun_run):
    with (
        FileLock(begun_run / ".lock"),
        pytest.raises(RuntimeError, match="another process trains in it"),
    ):
        run_training(None, begun_run)
    run_training(None, begun_run)


def test_weights_of_another_size_are_named(begun_run, tmp_path):
    config = preset("juggle", {**SMALL, "init": str(begun_run), "observe": "history"})
    with pytest.raises(ValueError, match=r"another size; it was trained"):
        run_training(config, tmp_path / "other")


NO_NUMBER = """
from dataclasses import dataclass
import numpy as np
from marl_airhockey.toolkit.falling import FallingPuck

@dataclass(frozen=True, kw_only=True)
class Bad(FallingPuck):
    seconds: float = 1.0

    def reward_terms(self, t):
        return {"x": np.nan * t.after.time[..., None]}

    def success(self, t):
        return t.after.time > 9.0
"""


@pytest.mark.parametrize("engine", ["torch", "sb3"])
def test_a_reward_that_is_no_number_is_named(engine, tmp_path):
    file = tmp_path / f"bad_{engine}.py"
    file.write_text(NO_NUMBER)
    config = preset(str(file), {**SMALL, "engine": engine})
    with pytest.raises(ValueError, match=r"reward terms \['x'\] are nan"):
        run_training(config, tmp_path / "run")
