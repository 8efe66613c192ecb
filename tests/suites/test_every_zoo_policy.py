"""The trained policies that come with the library do what their cards say."""

import re
import subprocess
import sys

import pytest

import marl_airhockey as ah
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.games import play_against
from marl_airhockey.policies.load import ZOO
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.registry import make_driver, zoo_names

# The lower levels of a game's ladder differ from its strongest by numbers alone.
# Policies of other profiles and tables are measured in the same way.
VARIANTS = [name for name in zoo_names() if re.search(r"_(\d|ur5e|full_size)$", name)]
SLOW = {*VARIANTS, "zoo/doubles", "zoo/free_for_all", "zoo/duel_robot"}
SLOW -= {"zoo/juggle_ur5e", "zoo/juggle_full_size"}
NAMES = [
    pytest.param(name, marks=pytest.mark.slow if name in SLOW else ())
    for name in zoo_names()
]


@pytest.mark.parametrize("name", zoo_names())
def test_it_is_small_and_its_card_is_of_today(name):
    path = ZOO / f"{name[4:]}.npz"
    assert path.stat().st_size < 300_000
    card = NumpyPolicy.load(path).card
    assert card["version"] == ah.make_scenario(card["scenario"]).version
    assert card["command"].startswith(f"airhockey train {card['scenario']} --seed")
    assert card["date"] >= "2026-11-21"


@pytest.mark.parametrize("name", NAMES)
def test_it_is_as_good_as_its_card(name):
    card = NumpyPolicy.load(ZOO / f"{name[4:]}.npz").card
    grades = card["grades"]
    options = {"backend": "numba", "profile": card["profile"]}
    options["options"] = card["options"]
    if "success" in grades:
        driver = ah.make_driver(name)
        found = evaluate(
            driver,
            card["scenario"],
            episodes=200,
            seed=7,
            name=name,
            exact=True,
            **options,
        )
        _, high = found.success_interval
        assert high >= grades["low"]
        return
    for opponent, (_, low, _) in grades["score"].items():
        opponents = [make_driver(opponent)]
        driver = ah.make_driver(name)
        score, _ = play_against(card["scenario"], driver, opponents, 40, 7, options)
        assert score[0] >= low - 0.2


@pytest.mark.parametrize(
    "task", ["juggle", "reach", "reach_velocity", "touch", "puck_velocity"]
)
def test_policies_of_the_tasks_of_a_real_table_are_fit_for_a_robot(task):
    # In 200 episodes chance alone moves a success of 0.955 below the bound.
    found = ah.evaluate(f"zoo/{task}_ur5e", episodes=2000)
    assert found.deployability.grade in "AB"
    assert found.success >= 0.95


def test_every_task_and_game_has_one():
    assert {f"zoo/{name}" for name in ah.scenario_names()} <= set(zoo_names())


def test_it_plays_without_a_deep_learning_library():
    code = (
        "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"
        "import marl_airhockey as ah\n"
        "env = ah.parallel_env('rally', drivers={'paddle_1': 'zoo/rally'})\n"
        "seen, _ = env.reset(seed=0)\n"
        "env.step({'paddle_0': [0.0, 0.0]})\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_soft_shots_do_not_beat_the_one_of_doubles():
    driver, opponents = make_driver("zoo/doubles"), [make_driver("allround:shot=0.3")]
    score, _ = play_against("doubles", driver, opponents, 40, 7, {})
    assert score[0] >= 0.8


def test_an_unknown_policy_is_named():
    with pytest.raises(ValueError, match=r"unknown policy of the zoo 'zoo/dule'"):
        ah.make_driver("zoo/dule")
