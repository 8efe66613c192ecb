"""SAC with hindsight goals: its policy as plain arrays, its files, what it refuses."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from typer.testing import CliRunner

import marl_airhockey as ah
from marl_airhockey.cli.main import app
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.learn.hindsight.config import CHOICES, hindsight_config
from marl_airhockey.learn.hindsight.sac import BUFFERS, HindsightTrainer, build_model
from marl_airhockey.learn.run import TrainingRun
from marl_airhockey.learn.train import load_any_config, run_training
from marl_airhockey.policies.load import load_policy

SMALL = {
    "num_worlds": 4,
    "hidden": [32, 32],
    "learning_starts": 1,
    "gradient_steps": 1,
    "total_steps": 1600,
    "evaluations": 2,
    "eval_episodes": 20,
}


def test_the_policy_of_a_file_is_that_of_the_model(tmp_path):
    config = hindsight_config("reach", SMALL)
    env = ah.make_sb3_vec("reach", 4, **config.keywords)
    trainer = HindsightTrainer(TrainingRun(config, tmp_path))
    trainer.model.learn(1200)
    policy, seen = trainer.policy(), env.reset()
    wanted, _ = trainer.model.predict(seen, deterministic=True)
    np.testing.assert_allclose(policy(seen), wanted, atol=1e-5)
    assert np.isfinite(policy.log_std).all()


def test_a_run_that_was_cut_goes_on(tmp_path):
    config = hindsight_config("reach", SMALL)

    class Cut(Exception):
        pass

    def stop(done, total, row):
        if row:
            raise Cut

    with pytest.raises(Cut):
        run_training(config, tmp_path / "run", stop)
    assert load_any_config(tmp_path / "run") == config
    row = run_training(None, tmp_path / "run")
    assert row["steps"] >= config.total_steps
    policy = load_policy(tmp_path / "run")
    found = evaluate(policy, "reach", episodes=20, **config.keywords)
    assert 0.0 <= found.success <= 1.0


def test_a_scenario_without_goals_is_named():
    with pytest.raises(ValueError, match=r"juggle has no goals.*hit_goal.*reach"):
        hindsight_config("juggle", {})


def test_a_run_shorter_than_an_episode_is_named(tmp_path):
    config = hindsight_config("reach", {**SMALL, "total_steps": 100})
    with pytest.raises(ValueError, match="total_steps: 100 must be above"):
        run_training(config, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_command_refuses_recordings(tmp_path):
    command = ["train", "reach", "--algo", "sac_her", "--data", str(tmp_path)]
    with pytest.raises(ValueError, match="sac_her learns in simulation"):
        CliRunner().invoke(app, command, catch_exceptions=False)


def samples_of(**changes):
    """Rewards and terminations (n,) of steps that a buffer has relabelled, or not."""
    config = hindsight_config("reach_velocity", SMALL | changes)
    env = ah.make_sb3_vec("reach_velocity", 4, **config.keywords)
    model = build_model(config, env)
    model.learn(1200)
    found = model.replay_buffer.sample(4000)
    env.close()
    return found.rewards[:, 0] > 0, found.dones[:, 0] > 0


def test_relabelled_steps_end_where_they_meet_their_goal():
    met, done = samples_of()
    assert 0.01 < met.float().mean() < 0.99
    assert (met == done).all()
    met, done = samples_of(ends="recorded")
    assert (met != done).float().mean() > 0.01


def test_settings_of_hindsight_are_checked():
    assert CHOICES["ends"] == tuple(BUFFERS)
    for name in CHOICES:
        with pytest.raises(ValueError, match=f"unknown {name} 'none'"):
            hindsight_config("reach", SMALL | {name: "none"})


def test_quantile_critics_learn_a_policy_of_the_same_form(tmp_path):
    pytest.importorskip("sb3_contrib")
    config = hindsight_config("reach", SMALL | {"critics": "quantiles"})
    run_training(config, tmp_path / "run")
    policy = load_policy(tmp_path / "run")
    assert evaluate(policy, "reach", episodes=5, goals="dict").episodes == 5
