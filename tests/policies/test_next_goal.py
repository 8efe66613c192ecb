"""Estimate of which side scores the next goal."""

import csv
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.policies.next_goal import VALUES, NextGoal
from marl_airhockey.registry import zoo_names

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs/data/next_goal.csv"
SAMPLES = ROOT / "scripts/reproduce/next_goal_samples.py"
SCENARIO = ah.make_scenario("duel")
SCENE = SCENARIO.scene
ESTIMATE = NextGoal.load("duel")


def states(count, seed=0):
    """States of paddles and puck at random positions, with random velocities."""
    rng, state = np.random.default_rng(seed), SCENE.still_state(count)
    state.position[:] = rng.uniform((-0.7, -0.2), (0.7, 0.2), state.position.shape)
    state.velocity[:] = rng.normal(0.0, 1.0, state.velocity.shape)
    return state


def shot(x, vx, own=(-0.2, 0.2), other=(0.2, -0.2)):
    """State of a puck that moves along the centre line, of goals without a keeper."""
    state = SCENE.still_state(1)
    state.position[0] = [own, other, (x, 0.0)]
    state.velocity[0, 2, 0] = vx
    return state


def seen_from_the_other_end(state):
    order = [1, 0, 2]
    position, velocity = -state.position[:, order], -state.velocity[:, order]
    return replace(state, position=position, velocity=velocity)


def test_chances_of_both_sides_add_up_to_one():
    every = states(100)
    for k in range(100):
        state = every.map(lambda x, k=k: x[k : k + 1])
        chance = ESTIMATE(state, SCENE)
        other = ESTIMATE(seen_from_the_other_end(state), SCENE)
        assert 0.0 < chance < 1.0
        assert chance + other == pytest.approx(1.0, abs=1e-12)


def test_a_centred_puck_between_equal_paddles_gives_one_half():
    assert ESTIMATE(shot(0.0, 0.0, (-0.6, 0.0), (0.6, 0.0)), SCENE) == 0.5


def test_a_leading_axis_changes_nothing():
    state = states(1)
    assert ESTIMATE(state.map(lambda x: x[0]), SCENE) == ESTIMATE(state, SCENE)


@pytest.mark.parametrize(("x", "speed"), [(0.5, 2.0), (0.6, 3.0), (0.4, 3.0)])
def test_a_shot_at_an_open_goal_is_nearly_certain(x, speed):
    assert ESTIMATE(shot(x, speed), SCENE) > 0.95
    assert ESTIMATE(shot(-x, -speed), SCENE) < 0.05


def test_a_goalkeeper_in_front_of_the_puck_lowers_the_chance():
    guarded = ESTIMATE(shot(0.4, 3.0, other=(0.7, 0.0)), SCENE)
    assert guarded < ESTIMATE(shot(0.4, 3.0), SCENE) - 0.2


def test_only_a_scene_like_that_of_the_training_fits():
    assert ESTIMATE.fits(SCENE)
    for options in (
        {"table": "full_size"},
        {"goal_width": 0.2},
        {"pucks": 2},
        {"seats": "robot"},
    ):
        assert not ESTIMATE.fits(ah.make_scenario("duel", **options).scene)


def test_a_scenario_without_a_file_has_no_estimate():
    assert NextGoal.load("juggle") is None


def test_the_file_is_small_has_no_pickle_and_is_no_policy():
    path = VALUES / "duel.npz"
    assert path.stat().st_size < 100_000
    with np.load(path, allow_pickle=False) as arrays:
        assert all(arrays[name].dtype.kind in "fU" for name in arrays.files)
    assert not [name for name in zoo_names() if "values" in name]
    with pytest.raises(ValueError, match="is not a policy file"):
        ah.make_driver(str(path))


def test_its_card_has_the_version_and_the_figures_of_the_test():
    card = ESTIMATE.network.card
    assert card["version"] == SCENARIO.version
    with FIGURES.open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["part"] == "test"
    for name in ("brier", "log_loss"):
        assert float(rows[0][name]) == card[name]
    assert card["brier"] < 0.25
    assert card["log_loss"] < np.log(2.0)
    for row in rows:
        if row["part"] == "estimate":
            assert float(row["estimate"]) == pytest.approx(
                float(row["scored"]), abs=0.03
            )


def test_samples_have_the_side_of_the_goal_after_them():
    next_goals = runpy.run_path(str(SAMPLES))["next_goals"]
    side, steps = next_goals(np.array([[1, 0, 0, -1, 1, 0], [0, 0, 0, 0, 0, 0]]).T)
    assert side[:, 0].tolist() == [-1, -1, -1, 1, 0, 0]
    assert steps[:4, 0].tolist() == [3, 2, 1, 1]
    assert not side[:, 1].any()
