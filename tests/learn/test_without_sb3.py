"""Training where stable-baselines3 is not installed."""

import subprocess
import sys

import pytest

pytest.importorskip("torch")
PROGRAM = """
import sys
sys.modules["stable_baselines3"] = None
import marl_airhockey as ah

result = ah.train(
    "touch",
    sys.argv[1],
    num_worlds=8,
    n_steps=16,
    batch_size=128,
    total_steps=256,
    evaluations=1,
    eval_episodes=2,
)
assert result.steps == 256
assert ah.evaluate(result.folder, episodes=2).scenario == "touch"
"""


@pytest.mark.slow
def test_the_engine_torch_trains_without_stable_baselines3(tmp_path):
    command = [sys.executable, "-c", PROGRAM, str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "best.npz").exists()
