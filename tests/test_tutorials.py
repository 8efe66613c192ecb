"""The tutorial scripts run as their pages say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def run(script, *options):
    command = [sys.executable, "-W", "ignore", str(ROOT / "scripts" / script), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.slow
def test_supersuit_shares_one_policy():
    out = run("tutorial_supersuit.py", "--steps", "20000", "--games", "20")
    assert 0 <= float(re.search(r"score against random: ([\d.]+)", out)[1]) <= 1


@pytest.mark.slow
def test_torchrl_trains_with_the_state():
    out = run("tutorial_torchrl.py", "--updates", "2", "--frames", "1000")
    assert out.count("crossings an episode") == 2
