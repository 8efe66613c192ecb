"""Measures of evaluation."""

from marl_airhockey.evaluation.deployability import Deployability
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.evaluation.stats import interval


def test_the_measures_of_a_match():
    low, high = interval(0.5, 200)
    assert 0.42 < low < 0.44
    assert 0.56 < high < 0.58
    assert interval(0.0, 100)[0] == 0.0
    calm = Deployability.of(0.0, 1.0, 0.05, 1.0, 0.05)
    assert calm.grade == "A"
    assert Deployability.of(0.0, 1.0, 0.3, 1.0, 0.05).grade == "C"
    assert Deployability.of(0.9, 1.0, 0.0, 1.0, 0.05).grade == "D"
    wild = evaluate("random", "reach", episodes=50).deployability
    still = evaluate("still", "reach", episodes=50).deployability
    assert still.violations_per_minute == 0
    assert still.grade == "A"
    assert wild.violations_per_minute > 600
    # White noise has half of its power in the upper half of the band.
    assert 0.4 < wild.power_above_5hz < 0.6
