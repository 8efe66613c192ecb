"""The tutorial scripts run as their pages say."""

import re

import pytest
from tutorials import run


@pytest.mark.slow
def test_supersuit_shares_one_policy():
    out = run("tutorials/with_supersuit.py", "--steps", "20000", "--games", "20")
    assert "a game against itself: {'paddle_0': " in out
    assert 0 <= float(re.search(r"score against random: ([\d.]+)", out)[1]) <= 1


@pytest.mark.slow
def test_torchrl_trains_with_the_state():
    out = run("tutorials/with_torchrl.py", "--updates", "2", "--frames", "1000")
    assert out.count("crossings an episode") == 2


@pytest.mark.slow
def test_recurrent_and_hindsight_policies_of_sb3_contrib_learn():
    out = run("tutorials/with_sb3_contrib.py", "--steps", "4000")
    assert out.count(" an episode, standard deviation ") == 2
