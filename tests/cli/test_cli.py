"""The command line as a user types it."""

import json
import subprocess
import sys

import pytest

import marl_airhockey as ah


def airhockey(*words, ok=True):
    command = [sys.executable, "-m", "marl_airhockey.cli", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode == 0) == ok, done.stderr
    return done


def test_list_names_everything():
    data = json.loads(airhockey("list", "--json").stdout)
    assert [row["name"] for row in data["scenarios"]] == ah.scenario_names()
    assert data["drivers"] == ah.agent_names()
    text = airhockey("list").stdout
    assert all(name in text for name in ah.scenario_names())


def test_list_describes_one(scenario):
    data = json.loads(airhockey("list", scenario, "--json").stdout)
    env = ah.parallel_env(scenario)
    labels = [row["label"] for row in data["observation"]]
    assert labels == list(env.observation_labels("paddle_0"))
    assert data["reward"]
    assert data["what"]


def test_evaluate_prints_what_papers_need():
    words = ("evaluate", "striker", "-s", "juggle", "--episodes", 30, "--json")
    data = json.loads(airhockey(*words).stdout)
    keys = {"success", "success_interval", "return", "length", "episodes"}
    assert keys | {"scenario", "driver", "backend"} <= set(data)
    assert set(data["beside"]) == {"still", "random", "sticky"}
    assert data["episodes"] == 30


def test_watch_writes_a_film(tmp_path):
    for name in ("a.gif", "a.mp4"):
        airhockey("watch", "striker", "-s", "strike", "--video", tmp_path / name)
        assert (tmp_path / name).stat().st_size > 5000


def test_demo_makes_what_it_says(tmp_path):
    done = airhockey("demo", "--out", tmp_path, "--steps", 20_000)
    for name in ("learning_curve.png", "juggle.gif", "report.json"):
        assert (tmp_path / name).exists()
        assert name in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    names = [row["driver"] for row in report["results"]]
    assert names == ["still", "random", "striker", "learned"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("list", "jugle"), "unknown scenario 'jugle'"),
        (("evaluate", "strker", "-s", "juggle"), "unknown driver 'strker'"),
        (("evaluate", "x.zip", "-s", "juggle"), "no such policy file"),
        (("train", "jugle"), "unknown scenario"),
        (("train", "juggle", "--set", "gama=1"), "unknown setting 'gama'"),
        (("train", "juggle", "--set", "gamma"), "NAME=VALUE"),
        (("train", "--resume", "nowhere"), "no training configuration"),
        (("train", "--resume", "nowhere", "--engine", "sb3"), "give nothing else"),
        (("train", "reach", "--engine", "jax"), "unknown engine 'jax'"),
        (("train", "reach", "--engine", "rllib", "--num-env-runners", "3"), "divide"),
        (("record", "report", "nowhere"), "no such folder"),
        (("watch", "nowhere.jsonl"), "cannot be read"),
        (("league", "duel", "--games", "0"), "--games"),
        (("watch", "still", "-s", "reach", "--video", "a.avi"), "must end in"),
    ],
)
def test_mistakes_give_one_line_and_a_non_zero_exit(words, message):
    done = airhockey(*words, ok=False)
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_bench_measures_and_draws(tmp_path):
    picture = tmp_path / "bench.png"
    done = airhockey(
        *("bench", "--scenario", "juggle,duel", "--worlds", "0,3", "--rounds", "1"),
        *("--seconds", "0.02", "--out", str(picture), "--json"),
    )
    rates = json.loads(done.stdout)
    assert [(r["scenario"], r["backend"], r["worlds"]) for r in rates] == [
        (s, b, n)
        for s in ("juggle", "duel")
        for b in ("numba", "pymunk")
        for n in (0, 3)
    ]
    for rate in rates:
        per_agent = rate["env_steps_per_cpu_s"] * rate["agents"]
        assert rate["agent_steps_per_cpu_s"] == per_agent > 0
    assert picture.stat().st_size > 10_000
