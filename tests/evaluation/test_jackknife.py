"""Intervals over groups: Student's t, the jackknife, and what they cover."""

import numpy as np
import pytest

from marl_airhockey.evaluation.stats import jackknife, student_t
from marl_airhockey.play.report import middle, share

QUANTILES = {3: 3.182446, 4: 2.776445, 9: 2.262157, 23: 2.068658, 99: 1.984217}
"""97.5 % quantiles of tables of Student's t, by degrees of freedom"""


@pytest.mark.parametrize(("degrees", "value"), QUANTILES.items())
def test_a_quantile_of_student(degrees, value):
    assert student_t(degrees) == pytest.approx(value, rel=2e-3)


def test_the_jackknife_of_a_mean_is_the_classical_interval():
    values = np.random.default_rng(0).normal(3.0, 2.0, 12)
    low, high = jackknife(12, lambda chosen: values[chosen].mean())
    half = student_t(11) * values.std(ddof=1) / np.sqrt(12)
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half))
    with pytest.raises(ValueError, match="4 groups; 5 are needed"):
        jackknife(4, lambda chosen: values[chosen].mean())


def test_games_of_a_person_are_not_counted_as_independent():
    rng = np.random.default_rng(1)
    skill = rng.normal(0.0, 1.0, 20)
    people = [(rng.normal(s, 0.1, 50)).tolist() for s in skill]
    _, low, high = middle(people, np.mean)
    expected = 2.0 * student_t(19) * skill.std(ddof=1) / np.sqrt(20)
    assert high - low == pytest.approx(expected, rel=0.1)


def test_shares_stay_within_0_and_1():
    assert share([[1.0]] * 8)[0] == 1.0
    assert 0.5 < share([[1.0]] * 8)[1] < 1.0
    assert share([[0.0, 0.0]] * 6)[2] > 0.0, "six people are not all people"
    low, high = share([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])[1:]
    assert (low, high < 1.0) == (0.0, True)
    assert np.isnan(share([[1.0], [0.0]])[1])
    assert np.isnan(share([])[0])
