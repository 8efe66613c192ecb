"""Rollouts: the episodes of a driver as arrays, and what is made of them."""

import json
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from command import airhockey

import marl_airhockey as ah
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.evaluation.evaluate import evaluate_recording
from marl_airhockey.evaluation.measures import measure
from marl_airhockey.rollouts.rollout import AT_ONCE

PROFILES = "ideal", "ur5e"
OTHER, SHORT = {"paddle_1": "striker"}, {"max_cycles": 20}


@pytest.mark.parametrize("profile", PROFILES)
def test_episodes_are_those_of_a_recording(profile, tmp_path):
    keywords = {"profile": profile}
    striker = ah.make_driver("striker")
    record_episodes(striker, "striker", "touch", 3, tmp_path / "r", 7, keywords)
    recorded = read_recording(tmp_path / "r").episodes
    played = list(ah.rollout("striker", "touch", episodes=3, seed=7, **keywords))
    for one, other in zip(played, recorded, strict=True):
        assert (one.index, one.seed, one.number) == (other.index, other.seed, 1)
        assert (one.physics, one.reason) == (other.physics, other.reason)
        assert one.columns.keys() == other.columns.keys()
        for name, value in one.columns.items():
            np.testing.assert_array_equal(value, other.columns[name], name)
        for name, value in one.first.items():
            np.testing.assert_array_equal(value, other.first[name], name)


def test_episodes_are_the_same_whatever_is_played_beside_them():
    many = ah.rollout("random", "duel", episodes=AT_ONCE + 2, drivers=OTHER, **SHORT)
    last = list(many)[-1]
    (alone,) = ah.rollout("random", "duel", seed=last.index, drivers=OTHER, **SHORT)
    assert alone.seed == last.seed
    for name, value in alone.columns.items():
        np.testing.assert_array_equal(value, last.columns[name], name)


def test_columns_are_those_that_are_named():
    names = "reward", "state.position"
    (episode,) = ah.rollout("still", "touch", columns=names)
    assert sorted(episode.columns) == sorted(names)
    assert sorted(episode.first) == ["state.position"]
    assert episode.columns["state.position"].shape == (len(episode), 2, 2)
    with pytest.raises(ValueError, match=r"unknown column 'rewards'.*reward"):
        next(ah.rollout("still", "touch", columns=["rewards"]))


def test_a_policy_plays_what_it_was_trained_in():
    (episode,) = ah.rollout("zoo/juggle_ur5e", columns=["sensed.age", "success"])
    assert episode.columns["sensed.age"].max() > 0.0


def test_wrong_requests_are_refused():
    with pytest.raises(ValueError, match="episodes"):
        next(ah.rollout("still", "touch", episodes=0))
    with pytest.raises(ValueError, match="paddle_1"):
        next(ah.rollout("still", "duel"))


def test_a_rollout_that_is_not_read_to_its_end_is_closed():
    played = ah.rollout("still", "touch", episodes=3 * AT_ONCE)
    assert [e.seed for e in islice(played, 2)] == [0, 1]
    played.close()
    with pytest.raises(StopIteration):
        next(played)


@pytest.mark.parametrize(("task", "profile"), [("strike", "ideal"), ("juggle", "ur5e")])
def test_a_recording_is_measured_as_its_play_was(task, profile, tmp_path):
    striker, keywords = ah.make_driver("striker"), {"profile": profile}
    record_episodes(striker, "striker", task, 20, tmp_path / "r", 3, keywords)
    found = evaluate_recording(tmp_path / "r")
    played = ah.evaluate(striker, task, episodes=20, seed=3, name="striker", **keywords)
    assert np.isnan(found.deployability.act_ms)
    timeless = [replace(r.deployability, act_ms=0.0) for r in (found, played)]
    assert timeless[0] == timeless[1]
    assert replace(found, deployability=played.deployability) == played
    shown = json.loads(airhockey("evaluate", tmp_path / "r", "--json").stdout)
    assert shown["success"] == found.success
    mixed = airhockey("evaluate", tmp_path / "r", "striker", ok=False)
    assert "recordings and drivers" in mixed.stderr


def test_recordings_are_compared_without_new_trials(tmp_path):
    for name in ("striker", "still"):
        driver = ah.make_driver(name)
        record_episodes(driver, name, "strike", 10, tmp_path / name, 3, {})
    told = airhockey("trials", tmp_path / "striker", tmp_path / "still", "--json")
    first, second = json.loads(told.stdout)["methods"]
    assert (first["trials"], second["trials"]) == (10, 10)
    assert first["success"] > second["success"]
    mixed = airhockey("trials", tmp_path / "striker", "still", ok=False)
    assert "recordings or policies" in mixed.stderr


def test_an_interrupted_episode_is_no_success():
    names = "delayed_action", "command", "violation", "returns", "success"
    (episode,) = ah.rollout("striker", "strike", seed=3, columns=names)
    assert measure(episode, 0.05).success
    found = measure(replace(episode, reason="camera: no frame"), 0.05)
    assert (found.success, found.interruption) == (False, "camera: no frame")
