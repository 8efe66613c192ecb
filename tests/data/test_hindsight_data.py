"""Hindsight: copies of recorded episodes with goals that were reached in them."""

import numpy as np
import pytest

from marl_airhockey.data.hindsight import ACHIEVED, DESIRED, with_hindsight
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.registry import make_driver
from marl_airhockey.rollouts.columns import scenario_of


def recorded(folder, scenario, driver, episodes=8, **keywords):
    path = folder / f"{scenario}-{driver.replace('/', '-')}"
    agent = make_driver(driver)
    return record_episodes(agent, driver, scenario, episodes, path, 0, keywords)


@pytest.mark.parametrize(
    ("task", "driver"),
    [
        ("reach", "zoo/reach"),
        ("reach_velocity", "random"),
        ("hit_goal", "zoo/hit_goal"),
        ("hit_goal_velocity", "zoo/hit_goal_velocity"),
    ],
)
def test_goal_is_met_at_the_last_step_and_not_before(tmp_path, task, driver):
    path = recorded(tmp_path, task, driver)
    new = read_recording(with_hindsight(path, task, tmp_path / "new", copies=3))
    game, old = scenario_of(new), read_recording(path).episodes
    assert len(new.episodes) > len(old)
    goals = set()
    for episode in new.episodes:
        desired = episode.columns[DESIRED][:, 0]
        assert (desired == episode.first[DESIRED]).all()
        goals.add(tuple(desired[0]))
        met = game.goal_reward(episode.columns[ACHIEVED][:, 0], desired) > 0
        assert met.tolist() == [False] * (len(met) - 1) + [True]
        assert episode.columns["reward"][:, 0].tolist() == met.tolist()
        assert episode.columns["terminated"].tolist() == met.tolist()
        source = next(e for e in old if e.seed == episode.seed)
        position = source.columns["state.position"][: len(episode)]
        assert np.array_equal(episode.columns["state.position"], position)
    assert len(goals) > len(old)


def test_play_of_another_task_becomes_data_of_a_goal_task(tmp_path):
    path = recorded(tmp_path, "reach_velocity", "random")
    new = read_recording(with_hindsight(path, "reach", tmp_path / "new", copies=1))
    assert new.head["scenario"] == "reach"
    assert new.head["options"]["goals"] == "dict"
    assert all(e.columns["success"][-1, 0] for e in new.episodes)


def test_hindsight_without_goals_is_refused(tmp_path):
    path = recorded(tmp_path, "juggle", "still", 2)
    with pytest.raises(ValueError, match="juggle: this scenario has no goals"):
        with_hindsight(path, "juggle", tmp_path / "new")
    path = recorded(tmp_path, "hit_goal", "still", 2, options={"seconds": 0.1})
    with pytest.raises(ValueError, match="no episode reached a goal of hit_goal"):
        with_hindsight(path, "hit_goal", tmp_path / "new")
    assert not (tmp_path / "new").exists()
