"""Policies play what they were trained in, unless something else is given."""

import json

import numpy as np
import pytest
from command import airhockey
from runs import SMALL

import marl_airhockey as ah
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.as_trained import as_trained, describe_environment

GENTLE = """
from dataclasses import dataclass
from marl_airhockey.scenarios.touch import Touch

@dataclass(frozen=True, kw_only=True)
class Gentle(Touch):
    price: float = 0.1
"""


@pytest.fixture(scope="module")
def gentle_run(tmp_path_factory):
    """The folder of a run of a scenario from a file, with more than one setting."""
    folder = tmp_path_factory.mktemp("gentle")
    (folder / "gentle.py").write_text(GENTLE)
    settings = {**SMALL, "profile": "gantry", "control_dt": 0.1}
    settings |= {"options": {"price": 0.3}, "physics": {"tilt": 4.0}}
    ah.train(str(folder / "gentle.py"), folder / "run", **settings)
    return folder / "run"


def test_zoo_policy_plays_in_the_profile_of_its_training():
    players = {"juggle_ur5e": make_driver("zoo/juggle_ur5e")}
    scenario, keywords = as_trained(players, None, {})
    assert (scenario, keywords["profile"]) == ("juggle", "ur5e")
    assert as_trained(players, None, {"profile": "ideal"})[1]["profile"] == "ideal"
    assert ah.evaluate("zoo/juggle_ur5e", episodes=1).profile == "ur5e"
    assert ah.evaluate("zoo/juggle_ur5e", episodes=1).observe == "estimate"


def test_run_keeps_scenario_options_profile_and_times(gentle_run):
    result = ah.evaluate(gentle_run, episodes=2)
    assert result.scenario == "gentle"
    assert (result.profile, result.control_dt) == ("gantry", 0.1)
    assert (result.observe, result.options) == ("estimate", {"price": 0.3})
    other = ah.evaluate(
        gentle_run, episodes=2, profile="ideal", control_dt=0.05, options={"price": 1.0}
    )
    assert (other.profile, other.control_dt) == ("ideal", 0.05)
    assert other.options == {"price": 1.0}


def test_commands_say_what_they_play(gentle_run):
    played = airhockey("evaluate", gentle_run, "--episodes", "2", "--no-floors")
    first = played.stdout.splitlines()[0]
    assert "profile gantry, observe estimate, control_dt 0.1 s" in first
    assert "price=0.3" in first
    assert "tilt=4.0" in first
    given = ("--profile", "ideal", "--json", "--no-floors", "--episodes", "2")
    found = json.loads(airhockey("evaluate", gentle_run, *given).stdout)
    assert found["profile"] == "ideal"


def test_code_that_was_not_trained_with_is_refused(gentle_run, tmp_path):
    file = gentle_run.parent / "gentle.py"
    text = file.read_text()
    try:
        file.write_text(text + "\n# changed\n")
        with pytest.raises(ValueError, match=r"its current state, .*gentle.py"):
            ah.evaluate(gentle_run, episodes=1)
        assert ah.evaluate(gentle_run, str(file), episodes=1).profile == "gantry"
    finally:
        file.write_text(text)


def test_policies_of_different_profiles_need_a_word():
    players = {name: make_driver(name) for name in ("zoo/duel", "zoo/duel_robot")}
    with pytest.raises(ValueError, match=r"profile: .*zoo/duel: ideal, .*ur5e"):
        as_trained(players, "duel", {})
    options = {"options": {"seats": "robot"}, "profile": "ur5e"}
    _, keywords = as_trained({"a": players["zoo/duel_robot"]}, "duel", options)
    assert keywords["options"] == {"seats": "robot", "reaction": 0}


def test_a_model_on_goals_gets_the_goals_apart():
    class Model:
        observation_space = ah.make_vec(
            "reach", 1, goals="dict"
        ).single_observation_space

        def predict(self, observation, deterministic=True):
            return np.zeros((len(observation["observation"]), 2)), None

    assert ah.evaluate(Model(), "reach", episodes=2).episodes == 2
    line = describe_environment("reach", {"goals": "dict"}, {"x": make_driver("still")})
    assert line == "reach: profile ideal, control_dt 0.05 s"


def test_physics_that_are_given_add_to_those_of_training(gentle_run):
    result = ah.evaluate(gentle_run, episodes=1, physics={"puck_drag": 0.03}, seed=5)
    assert result.physics == {"tilt": 4.0, "puck_drag": 0.03}
    assert result.to_json()["seed"] == 5


def test_a_task_that_is_gone_is_named(gentle_run):
    file = gentle_run.parent / "gentle.py"
    kept = file.rename(file.with_suffix(".kept"))
    try:
        with pytest.raises(ValueError, match=r"gentle\.py, but this file does"):
            ah.evaluate(gentle_run, episodes=1)
    finally:
        kept.rename(file)


def test_the_measured_seat_takes_no_other_driver():
    with pytest.raises(
        ValueError, match="paddle_0 is the seat of the evaluated driver"
    ):
        ah.evaluate("striker", "touch", episodes=1, drivers={"paddle_0": "still"})
