"""The tutorial scripts run as their pages say."""

import re

import pytest
from tutorials import run


@pytest.mark.slow
def test_supersuit_shares_one_policy():
    out = run("tutorial_supersuit.py", "--steps", "20000", "--games", "20")
    assert 0 <= float(re.search(r"score against random: ([\d.]+)", out)[1]) <= 1


@pytest.mark.slow
def test_torchrl_trains_with_the_state():
    out = run("tutorial_torchrl.py", "--updates", "2", "--frames", "1000")
    assert out.count("crossings an episode") == 2
