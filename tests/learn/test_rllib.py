"""The engine "rllib": many processes, resumed, and in spite of killed ones.

`make test-distributed` runs these in an environment that has Ray.
"""

import csv
import os
import signal
import subprocess
import sys
import time

import pytest
from tutorials import run

from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.export import export_policy
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training

ray = pytest.importorskip("ray", reason="Ray has an environment of its own")

TOUCH = {"engine": "rllib", "num_worlds": 32, "batch_size": 256, "eval_episodes": 10}
DUEL = {**TOUCH, "options": {"seconds": 3.0}, "opponents": ["random"], "snapshots": 8}


@pytest.fixture(scope="module", autouse=True)
def a_ray_of_our_own():
    yield
    ray.shutdown()


def rows(folder):
    with (folder / "evaluations.csv").open() as file:
        return list(csv.DictReader(file))


def test_it_learns_and_its_policy_drives_without_ray(tmp_path):
    folder = tmp_path / "touch-0"
    changes = {**TOUCH, "total_steps": 98_304, "evaluations": 2, "num_env_runners": 2}
    row = run_training(preset("touch", changes), folder)
    assert row["steps"] == 98_304
    assert [int(r["steps"]) for r in rows(folder)] == [49_152, 98_304]
    still = evaluate("still", "touch", episodes=200)
    learned = evaluate(str(folder), "touch", episodes=200)
    assert learned.success > still.success + 0.3
    code = (
        "import sys, numpy as np, marl_airhockey as ah\n"
        f"world = ah.make_world('touch', drivers={{'paddle_0': {str(folder)!r}}})\n"
        "world.reset(seed=0); world.step(np.zeros((1, 0, 2)))\n"
        "assert 'ray' not in sys.modules and 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    exported = export_policy(folder, tmp_path / "touch.npz")
    assert "engine" in exported.card["command"]


@pytest.mark.slow
def test_self_play_goes_on_when_a_runner_is_killed(tmp_path):
    from marl_airhockey.learn.rllib import build_algorithm, start_ray

    start_ray(2)
    algo = build_algorithm(preset("duel", {**DUEL, "num_env_runners": 2}), tmp_path)
    group = algo.env_runner_group
    pids = group.foreach_env_runner(lambda _: os.getpid(), local_env_runner=False)
    assert len(set(pids)) == 2
    before = algo.train()["env_runners"]["num_env_steps_sampled"]
    os.kill(pids[0], signal.SIGKILL)
    for _ in range(20):
        after = algo.train()["env_runners"]["num_env_steps_sampled"]
        assert after >= before
        if group.num_healthy_remote_workers() == 2:
            break
        time.sleep(1.0)
    fresh = group.foreach_env_runner(lambda _: os.getpid(), local_env_runner=False)
    assert len(set(fresh)) == 2
    assert set(fresh) != set(pids)
    assert list((tmp_path / "pool-2").glob("*.npz")), "snapshots of itself to meet"
    algo.stop()


@pytest.mark.slow
def test_a_killed_run_goes_on_where_it_stood(tmp_path):
    folder = tmp_path / "killed"
    command = [sys.executable, "-m", "marl_airhockey.cli", "train", "touch"]
    command += ["--engine", "rllib", "--steps", "400000", "--out", str(folder)]
    for setting in ("num_worlds=32", "batch_size=256", "evaluations=40"):
        command += ["--set", setting]
    process = subprocess.Popen(
        [*command, "--set", "eval_episodes=5"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while not (folder / "state.json").exists() or len(rows(folder)) < 3:
        assert process.poll() is None, "it ended before it could be killed"
        time.sleep(0.1)
    process.kill()
    process.wait()
    stood = [int(row["steps"]) for row in rows(folder)]
    assert stood[-1] < 400_000
    row = run_training(None, folder)
    assert row["steps"] >= 400_000
    assert [int(r["steps"]) for r in rows(folder)][: len(stood)] == stood
    assert len(list(folder.glob("rllib-*"))) == 1


@pytest.mark.slow
def test_the_tutorial_runs():
    out = run("tutorials/with_rllib.py", "--iterations", "1", "--steps", "1000")
    assert "p0 as a driver scores" in out
