"""Statistics of runs and ratings of players."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.evaluation.over_runs import OverRuns
from marl_airhockey.evaluation.stats import (
    bootstrap,
    bounded_mean,
    elo,
    iqm,
    over_tasks,
    performance_profile,
    probability_of_improvement,
    without_nan,
)


def test_ratings_follow_the_model_they_come_from():
    true = np.array([1200.0, 1000.0, 800.0])
    share = 1 / (1 + 10 ** (-np.subtract.outer(true, true) / 400))
    games = 4000.0 * (1 - np.eye(3))
    np.testing.assert_allclose(elo(share * games, games), true, atol=1.0)
    alone = elo(np.array([[0.0, 10.0], [0.0, 0.0]]), np.array([[0, 10.0], [10.0, 0]]))
    assert np.isfinite(alone).all()


def test_statistics_of_runs():
    assert iqm(np.array([-100.0, 1.0, 2.0, 3.0, 4.0, 100.0, 2.5, 2.5])) == 2.5
    assert iqm(np.arange(5)) == pytest.approx(2.0)
    low, high = bootstrap(np.random.default_rng(0).normal(5.0, 1.0, 200))
    assert low < 5.0 < high
    assert high - low < 0.5
    assert bootstrap(np.ones(4)) == (1.0, 1.0)
    assert probability_of_improvement([1, 2, 3], [0, 0, 0]) == 1.0
    assert probability_of_improvement([1, 2], [1, 2]) == 0.5
    with pytest.raises(ValueError, match="no values"):
        iqm(np.array([]))


def test_statistics_over_tasks_weight_tasks_equally():
    runs = [np.array([0.0, 0.2]), np.array([1.0, 1.0, 0.7])]
    value, low, high = over_tasks(runs, lambda values: values.mean())
    assert value == pytest.approx((0.1 + 0.9) / 2)
    # No resample leaves its task.
    assert 0.35 <= low < value < high <= 0.6
    same = [np.full(3, 0.5), np.full(5, 0.9)]
    assert over_tasks(same, iqm) == pytest.approx((0.7, 0.7, 0.7))
    levels = np.array([0.0, 0.5, 0.95])
    profile, *ends = over_tasks(same, lambda x: performance_profile(x, levels))
    assert profile.tolist() == [1.0, 0.5, 0.0]
    assert np.array_equal(ends, [profile, profile])


def test_runs_are_summed_up_over_runs_and_over_episodes():
    names = "zoo/touch", "zoo/touch_ur5e", "still"
    results = [ah.evaluate(name, "touch", episodes=50) for name in names]
    found = OverRuns.of(results)
    success = [result.success for result in results]
    assert (found.runs, found.success) == (3, pytest.approx(np.mean(success)))
    # Runs differ far more than the chance of 150 episodes.
    low, high = found.over_runs
    assert (low, high) == pytest.approx((min(success), max(success)))
    assert low < found.over_episodes[0] < found.over_episodes[1] < high
    assert "success of 3 runs: " in found.text


def test_intervals_of_bounded_answers_stay_inside_the_scale():
    rng = np.random.default_rng(0)
    for n in (5, 8, 24):
        for _ in range(50):
            groups = rng.choice([1.0, 6.0, 7.0], (n, 2), p=[0.1, 0.2, 0.7]).tolist()
            mean, low, high = bounded_mean(groups, (1.0, 7.0))
            assert 1.0 <= low <= mean <= high <= 7.0
            assert mean == pytest.approx(np.mean(groups))
    assert bounded_mean([[2.0]] * 4, (1.0, 7.0))[0] == 2.0
    assert np.isnan(bounded_mean([[2.0]] * 4, (1.0, 7.0))[1:]).all()
    mean, low, high = bounded_mean([[7.0]] * 8, (1.0, 7.0))
    assert (mean, high) == (7.0, 7.0)
    assert 4.0 < low < 6.0


@pytest.mark.parametrize(("n", "least"), [(6, 0.9), (24, 0.93)])
def test_intervals_of_bounded_answers_contain_the_mean(n, least):
    rng, hits = np.random.default_rng(1), 0
    chances = np.array([0.05, 0.1, 0.15, 0.2, 0.2, 0.2, 0.1])
    truth = float(chances @ np.arange(1, 8))
    for seed in range(400):
        groups = rng.choice(np.arange(1.0, 8.0), (n, 1), p=chances)
        _, low, high = bounded_mean(groups.tolist(), (1.0, 7.0), seed)
        hits += low <= truth <= high
    assert least <= hits / 400 <= 0.98


def test_json_has_no_nan():
    data = {"a": [1.0, float("nan")], "b": (2, {"c": float("nan")})}
    assert without_nan(data) == {"a": [1.0, None], "b": [2, {"c": None}]}
    found = ah.evaluate("still", "touch", episodes=1, control_dt=0.1).to_json()
    assert found["deployability"]["power_above_5hz"] is None
    table = ah.league("duel", ["still", "random"], games=2).to_json()
    assert table["score"][0][0] is None
