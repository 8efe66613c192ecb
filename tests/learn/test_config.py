"""Presets and settings of training."""

import pytest

from marl_airhockey.learn.ppo_config import PPOConfig, preset
from marl_airhockey.learn.settings import load_config


def test_presets_are_whole_and_bad_settings_are_named(scenario):
    config = preset(scenario, {"seed": 3})
    assert config.total_steps > 0
    assert config.seed == 3
    with pytest.raises(ValueError, match="did you mean 'gamma'"):
        preset(scenario, {"gama": 0.9})
    with pytest.raises(ValueError, match="num_worlds"):
        preset(scenario, {"num_worlds": 0})
    with pytest.raises(ValueError, match="batch_size"):
        preset(scenario, {"num_worlds": 3})
    with pytest.raises(ValueError, match="learning_rate"):
        preset(scenario, {"learning_rate": "fast"})


def test_a_configuration_survives_its_file(tmp_path):
    changes = {"options": {"pucks": 2}, "profile": "ur5e", "hidden": [32]}
    config = preset("juggle", changes)
    assert config.observe == "estimate"
    path = tmp_path / "config.toml"
    path.write_text(config.to_toml())
    assert load_config(PPOConfig, path) == config
    path.write_text("nothing = 1")
    with pytest.raises(ValueError, match="not a training configuration"):
        load_config(PPOConfig, path)


def test_policies_for_robots_learn_with_faster_servos_than_they_are_measured_with():
    config = preset("juggle", {"profile": "ur5e", "physics": {"puck_drag": 0.02}})
    assert config.training_keywords["physics"] == {
        "servo_time": [0.0, 0.1],
        "puck_drag": 0.02,
    }
    assert config.keywords["physics"] == {"puck_drag": 0.02}
    given = preset("juggle", {"profile": "ur5e", "physics": {"servo_time": 0.07}})
    assert given.training_keywords["physics"] == {"servo_time": 0.07}
    assert preset("juggle").training_keywords == preset("juggle").keywords
    with pytest.raises(ValueError, match="unknown profile 'robot'"):
        preset("juggle", {"profile": "robot"})


def test_shots_are_paid_in_training_alone():
    config = preset("duel")
    assert config.training_keywords["options"]["shot_weight"] > 0.0
    assert "shot_weight" not in config.keywords["options"]
    given = preset("duel", {"options": {"shot_weight": 0.0}})
    assert given.training_keywords["options"] == {"shot_weight": 0.0}


def test_a_range_whose_ends_are_exchanged_is_refused():
    with pytest.raises(ValueError, match="opponent_speed_range"):
        preset("duel", {"opponent_speed_range": [0.9, 0.1]})
