"""Statistics of runs and ratings of players."""

import numpy as np
import pytest

from marl_airhockey.evaluation.stats import (
    bootstrap,
    elo,
    iqm,
    probability_of_improvement,
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
