"""Curriculum: ranges of starts that widen with success in training."""

import json

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.train import run_training
from marl_airhockey.sim.core.rng import RandomStreams


def test_a_narrow_range_is_a_share_about_the_middle():
    seeds = np.arange(500)
    whole, narrow = (RandomStreams.keyed(seeds, seeds, "start") for _ in range(2))
    narrow.spread = 0.2
    a, b = (streams.uniform(2.0, 4.0, 3) for streams in (whole, narrow))
    np.testing.assert_allclose(b - 3.0, 0.2 * (a - 3.0), atol=1e-12)
    np.testing.assert_array_equal(whole.normal(2), narrow.normal(2))
    assert narrow.select(np.arange(3)).spread == 0.2


@pytest.mark.parametrize("task", ["hit_goal_velocity", "move_block", "reach"])
def test_every_start_can_be_narrowed(task):
    spans = []
    for spread in (1.0, 0.1):
        world = ah.make_world(task, 300)
        world.start_spread = spread
        world.reset(0)
        spans.append(np.ptp(world.state.paddle[:, 0, 1]))
    assert spans[1] == pytest.approx(0.1 * spans[0], rel=1e-6)


def test_ranges_widen_in_training_and_are_kept_with_the_run(tmp_path):
    changes = {
        **{"total_steps": 40_000, "num_worlds": 64, "batch_size": 512},
        **{"evaluations": 2, "eval_episodes": 4, "curriculum": 0.3},
    }
    run_training(preset("touch", changes), tmp_path / "run")
    state = json.loads((tmp_path / "run" / "state.json").read_text())
    assert 0.3 < state["start_spread"] <= 1.0


def test_bad_curricula_are_refused():
    with pytest.raises(ValueError, match="curriculum"):
        preset("touch", {"curriculum": 1.5})
    with pytest.raises(ValueError, match="curriculum"):
        preset("duel", {"curriculum": 0.5})
