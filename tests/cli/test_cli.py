"""The command line as a user types it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import airhockey
from PIL import Image

import marl_airhockey as ah
from marl_airhockey.envs.meanings import term_meanings
from marl_airhockey.policies.load import load_policy


def process(*words, ok=True, cwd=None):
    """Run a command in a process of its own, as a user does."""
    command = [sys.executable, "-m", "marl_airhockey.cli", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=cwd)
    assert (done.returncode == 0) == ok, done.stderr
    return done


def test_list_names_everything():
    data = json.loads(airhockey("list", "--json").stdout)
    assert [row["name"] for row in data["scenarios"]] == ah.scenario_names()
    assert data["drivers"] == ah.driver_names()
    text = airhockey("list").stdout
    assert all(name in text for name in ah.scenario_names())


def test_list_describes_one(scenario):
    data = json.loads(airhockey("list", scenario, "--json").stdout)
    env = ah.parallel_env(scenario)
    labels = [row["label"] for row in data["observation"]]
    assert labels == list(env.observation_labels("paddle_0"))
    assert data["reward"]
    for key in ("description", "start", "termination", "success"):
        assert data[key], key
    for row in (*data["reward"], *data["options"], *data["observation"]):
        assert row["meaning"], f"{row} says nothing"


def test_evaluate_prints_what_papers_need():
    words = ("evaluate", "striker", "-s", "juggle", "--episodes", 30, "--json")
    data = json.loads(airhockey(*words).stdout)
    keys = {"success", "success_interval", "return", "length", "episodes"}
    assert keys | {"scenario", "driver", "backend"} <= set(data)
    assert set(data["beside"]) == {"still", "random", "sticky"}
    assert data["episodes"] == 30


def test_a_policy_is_measured_where_it_was_trained_unless_told_otherwise():
    words = ("evaluate", "zoo/touch", "--episodes", 5, "--no-floors", "--json")
    assert json.loads(airhockey(*words).stdout)["scenario"] == "touch"
    told = airhockey("evaluate", "striker", "--episodes", 5, ok=False).stderr
    assert "scenario: none is known" in told


def test_watch_writes_a_film(tmp_path):
    for name in ("a.gif", "a.mp4", "a.webp"):
        airhockey("watch", "striker", "-s", "strike", "--video", tmp_path / name)
        assert (tmp_path / name).stat().st_size > 5000


def test_demo_makes_what_it_says(tmp_path):
    done = process("demo", "--out", tmp_path, "--steps", 20_000)
    for name in ("learning_curve.png", "juggle.gif", "report.json"):
        assert (tmp_path / name).exists()
        assert name in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    names = [row["driver"] for row in report["results"]]
    assert names == ["still", "random", "striker", "learned"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("list", "jugle"), "profile 'jugle' (did you mean 'juggle'?)"),
        (("evaluate", "strker", "-s", "juggle"), "(did you mean 'striker'?)"),
        (("evaluate", "runs/none"), "runs/none: there is no such run"),
        (("evaluate", "zoo/hit_goal", "-s", "juggle"), "it was trained on hit_goal"),
        (("evaluate", "zoo/nobody"), "unknown policy of the zoo 'zoo/nobody'; there"),
        (("evaluate", "still", "-s", "juggle", "--option", "lft=3"), "mean 'lift'?"),
        (("evaluate", "still", "-s", "juggle", "--physics", "tlt=3"), "mean 'tilt'?"),
        (("fit-table", "none.csv"), "none.csv: this file does not exist"),
        (("evaluate", "x.zip", "-s", "juggle"), "no such policy file"),
        (("train", "jugle"), "unknown scenario"),
        (("train", "juggle", "--set", "gama=1"), "unknown setting 'gama'"),
        (("train", "juggle", "--set", "gamma"), "NAME=VALUE"),
        (("train", "--resume", "nowhere"), "not a training configuration"),
        (("train", "--resume", "nowhere", "--engine", "sb3"), "remove all other"),
        (("train", "reach", "--engine", "jax"), "unknown engine 'jax'"),
        (("train", "reach", "--engine", "rllib", "--num-env-runners", "3"), "divide"),
        (("data", "report", "nowhere"), "this folder does not exist"),
        (("data", "check", "nowhere"), "no such file or folder"),
        (("league", "duel", "--games", "0"), "--games"),
        (("league", "rally"), "use airhockey crossplay rally"),
        (("export", "nowhere"), "nowhere: this is not the folder of a training run"),
        (
            ("fit", "--recordings", "nowhere"),
            "no such file or folder",
        ),
        (
            ("evaluate", "still", "-s", "touch", "--physics", "tilt=a:b"),
            "--physics tilt=a:b: expected NAME=VALUE or NAME=LOW:HIGH",
        ),
        (
            ("fit", "juggle", "--backend", "numba", "--steps", "20"),
            "record more steps (--steps), or pass more recordings",
        ),
        (("watch", "still", "-s", "reach", "--video", "a.avi"), "must end in"),
        (
            ("evaluate", "still", "-s", "duel", *("--driver", "paddle_1=striker") * 2),
            "paddle_1 is given twice",
        ),
        (
            ("evaluate", "still", "-s", "touch", *("--physics", "tilt=3") * 2),
            "tilt is given twice",
        ),
        (
            ("evaluate", "still", "-s", "touch", *("--physics", "wooden") * 2),
            "preset is given twice",
        ),
        (("train", "touch", "--driver", "paddle_0=striker"), "leave one seat open"),
        (("train", "touch", "--num-env-runners", "4"), "only the engine rllib"),
        (("train", "touch", "--seed", "-1"), "seed: -1 must be 0 or more"),
        (
            ("train", "--algo", "iql", "--data", "x", "--engine", "sb3"),
            "engine: iql has no such setting, only ppo",
        ),
        (("league", "duel", "--out", __file__), "is a file"),
        (("league", "duel", "--exploit", "-5"), "--exploit"),
        (
            (
                "evaluate",
                "still",
                "-s",
                "reach",
                "--backend",
                "real",
                "--rig",
                __file__,
            ),
            "not a rig, expected a JSON file; airhockey calibrate",
        ),
    ],
)
def test_a_mistake_gives_a_short_message_and_a_non_zero_exit(words, message):
    done = airhockey(*words, ok=False)
    # The box around an error wraps where the length of a path says.
    assert message in " ".join(done.stderr.replace("│", " ").split())
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


def test_it_tells_its_version():
    assert process("--version").stdout.split() == ["marl_airhockey", ah.__version__]


def test_precompile_reports_what_it_compiles_and_names_bad_input(tmp_path):
    assert "reach" in airhockey("precompile", "reach").stderr
    for words, reason in (
        (("jugle",), "unknown scenario 'jugle'"),
        (("--target", "pentium", "--out", tmp_path), "unknown target 'pentium'"),
        (("--target", "generic", "--out", tmp_path), "this folder exists; give a new"),
        (("--target", "generic"), "--target and --out need each other"),
        (("--out", tmp_path), "--target and --out need each other"),
    ):
        assert reason in airhockey("precompile", *words, ok=False).stderr


def test_a_new_scenario_and_a_new_driver_run(tmp_path):
    for kind, name in (("scenario", "my_bank"), ("driver", "my_push")):
        done = process("new", kind, name, "--out", tmp_path)
        assert f"{name}.py" in "".join(done.stdout.split())
        again = process("new", kind, name, "--out", tmp_path, ok=False)
        assert "this file exists" in again.stderr
    words = ("-s", "my_bank.py", "--episodes", 20, "--backend", "numba", "--json")
    done = process("evaluate", "my_push.py:behind=0.1", *words, cwd=tmp_path)
    data = json.loads(done.stdout)
    assert data["return"] > data["beside"]["still"]["return"]
    assert "3, once." in process("list", "my_bank.py", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("scenario", "juggle"), "a scenario has this name"),
        (("driver", "striker"), "a driver has this name"),
        (("driver", "numpy"), "a keyword or a module of Python"),
        (("scenario", "class"), "a keyword or a module of Python"),
        (("driver", "My-Push"), "expected lower-case letters"),
        (("driver", "my_push", "--out", "nowhere"), "this folder does not exist"),
    ],
)
def test_a_name_that_cannot_be_new_is_refused(words, message, tmp_path):
    assert message in airhockey("new", *words, ok=False, cwd=tmp_path).stderr


def test_a_pickle_is_refused_unless_it_is_trusted(tmp_path):
    from stable_baselines3 import PPO

    model = PPO("MlpPolicy", ah.make_sb3_vec("reach", 2), n_steps=8, batch_size=16)
    model.save(tmp_path / "model.zip")
    words = ("evaluate", tmp_path / "model.zip", "-s", "reach", "--episodes", 2)
    assert "--trust" in process(*words, ok=False).stderr
    assert "success" in process(*words, "--trust", "--no-floors").stdout


def test_meanings_are_those_of_the_nearest_class():
    class Own(type(ah.make_scenario("touch"))):
        def reward_terms(self, t):
            """Return the terms.

            touch: 5 for each touch,
            even a late one.
            """

    meanings = term_meanings(Own)
    assert meanings["touch"] == "5 for each touch, even a late one."
    assert meanings["drop"] == "-1 when the puck crosses the home line."
    assert meanings["jitter"].startswith("``-jitter_weight``")


def test_physics_takes_presets_values_and_ranges():
    words = ("evaluate", "still", "-s", "touch", "--no-floors", "--episodes", "2")
    given = ("--physics", "wooden", "--physics", "tilt=3:6", "--physics", "puck_drag=0")
    line = airhockey(*words, *given).stdout.splitlines()[0]
    assert "physics preset=wooden tilt=(3.0, 6.0) puck_drag=0.0" in line


def test_resuming_a_finished_run_says_how_to_train_on(touch_run):
    said = airhockey("train", "--resume", touch_run).stdout
    assert "this run is complete" in said
    assert f"--init {touch_run}" in said


def test_an_exported_onnx_model_acts_as_the_run_and_knows_its_card(touch_run, tmp_path):
    path = tmp_path / "touch.onnx"
    airhockey("export", touch_run, "--out", path)
    model, run = load_policy(path), load_policy(touch_run / "last.npz")
    observation = np.random.default_rng(0).normal(size=(50, *run.shape))
    expected = np.clip(run.predict(observation, True), -1.0, 1.0)
    np.testing.assert_allclose(model.predict(observation, True), expected, atol=1e-5)
    assert (model.observe, model.trained_in["scenario"]) == ("velocity", "touch")
    with pytest.raises(ValueError, match=rf"\(B, {run.shape[0]}\) are expected"):
        run.predict(observation[:, :3], True)
    shown = airhockey("evaluate", path, "--episodes", "5", "--no-floors").stdout
    assert "sampled" not in shown
    done = airhockey("export", touch_run, "--out", tmp_path / "touch.pt", ok=False)
    assert "must end in .npz or .onnx" in done.stderr


def test_the_benchmark_of_engines_says_what_it_is_without_ray():
    script = Path(__file__).parents[2] / "scripts/bench/engines.py"
    done = subprocess.run(
        [sys.executable, script, "--help"], capture_output=True, text=True, check=True
    )
    assert "Measure all trainers" in done.stdout


def test_several_runs_are_summed_up(touch_run):
    words = ("evaluate", touch_run, touch_run / "last.npz", "--episodes", "5")
    assert "success of 2 runs: " in airhockey(*words, "--no-floors").stdout
    data = json.loads(airhockey(*words, "--no-floors", "--json").stdout)
    assert data["over_runs"]["runs"] == 2


def test_suites_are_listed_and_two_drivers_compared():
    assert "defence-v1" in airhockey("suite", "list").stdout
    tasks = json.loads(airhockey("suite", "list", "--json").stdout)
    assert {task["rule"] for task in tasks} == {"keep", "score", "pass"}
    words = ("suite", "run", "still", "defence-v1", "--against", "goalkeeper")
    shown = " ".join(airhockey(*words).stdout.split())
    assert "only still solves 0 pieces, only goalkeeper" in shown
    found = json.loads(airhockey(*words, "--json").stdout)
    still, keeper = found["results"]
    assert still["success"] == 0.0
    assert sum(keeper["solved"]) == keeper["success"] * 1000
    (pair,) = found["differences"].values()
    assert pair["only_second"] == keeper["success"] * 1000
    assert pair["p_value"] < 1e-6
    slow = (*words[:2], "goalkeeper", "defence-v1", "--option", "reaction=0.4")
    (late,) = json.loads(airhockey(*slow, "--json").stdout)["results"]
    assert late["success"] < keeper["success"]


def test_pieces_of_a_suite_become_a_video(tmp_path):
    video = tmp_path / "piece.gif"
    words = "suite", "watch", "solution", "defence-v1", "--piece", "3"
    assert "wrote" in airhockey(*words, "--pieces", "2", "--video", video).stdout
    with Image.open(video) as shown:
        assert shown.n_frames > 20


def test_a_league_with_another_seed_plays_other_games(tmp_path):
    words = ("league", "duel", "striker", "random", "--games", "2", "--json")
    tables = [
        json.loads(airhockey(*words, "--seed", seed, "--out", tmp_path).stdout)
        for seed in (1, 1, 2)
    ]
    assert tables[0]["goal_difference"] == tables[1]["goal_difference"]
    assert tables[0]["goal_difference"] != tables[2]["goal_difference"]


def test_recordings_are_made_checked_divided_and_drawn(tmp_path):
    made = tmp_path / "made"
    record = "data", "record", "striker", "-s", "touch", "--out", str(made)
    airhockey(*record, "--episodes", "3")
    done = airhockey(*record, "--episodes", "10", "--json")
    (row,) = json.loads(done.stdout)["recordings"]
    assert (row["episodes"], row["cut_off"]) == (10, 0)
    assert "10 good episodes, 0 faults" in airhockey("data", "check", str(made)).stdout
    airhockey("data", "split", str(made), "--out", str(tmp_path / "parts"))
    picture = tmp_path / "content.png"
    airhockey("data", "plot", str(tmp_path / "parts"), "--out", str(picture))
    assert picture.stat().st_size > 10_000
    (part,) = (made / "steps").iterdir()
    part.write_bytes(part.read_bytes()[:-100])
    done = airhockey("data", "check", str(made), ok=False)
    assert "cannot be read as parquet" in done.stdout
    assert "Traceback" not in done.stderr
