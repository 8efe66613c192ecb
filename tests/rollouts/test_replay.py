"""Replayed recordings: what follows from recorded states is what was recorded."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import marl_airhockey as ah
from marl_airhockey.cli.main import app
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.relabel import fitting, relabelled
from marl_airhockey.data.verify import EXACT, distance, replay_differences
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.sim.core.recording import Recording


def recorded(path, scenario, episodes=3, **keywords):
    """A recording of scripts at all seats."""
    name = "reacher" if scenario.startswith("reach") else "striker"
    seats = len(ah.make_scenario(scenario).scene.seats)
    drivers = {f"paddle_{i}": "striker" for i in range(1, seats)}
    keywords = {"max_cycles": 160, "drivers": drivers, **keywords}
    record_episodes(ah.make_driver(name), name, scenario, episodes, path, 7, keywords)
    return read_recording(path)


@pytest.mark.parametrize("profile", ["ideal", "ur5e"])
def test_it_computes_what_was_recorded(scenario, profile, tmp_path):
    recording = recorded(tmp_path / "r", scenario, profile=profile)
    found = replay_differences(recording.path)
    columns = set(recording.episodes[0].columns)
    assert set(found) == columns
    assert {n: d for n, d in found.items() if not d <= EXACT} == {}


@pytest.mark.parametrize("observe", ["history", "estimate"])
def test_observations_of_a_sensor_are_those_of_the_recording(observe, tmp_path):
    recording = recorded(tmp_path / "r", "juggle", profile="ur5e", observe=observe)
    found = replay_differences(recording.path)
    assert found["observation"] <= EXACT
    assert found["sensed.position"] <= EXACT


def test_a_pymunk_recording_is_judged_by_the_same_rules(tmp_path):
    recording = recorded(tmp_path / "r", "duel", backend="pymunk")
    assert max(replay_differences(recording.path).values()) <= EXACT


def test_another_task_judges_the_recorded_states(tmp_path):
    recording = recorded(tmp_path / "r", "juggle")
    replay = Replay(recording, ah.make_scenario("touch"))
    replay.begin()
    touches = [np.zeros(3)]
    for t in range(int(replay.lengths.max())):
        replay.step(t)
        touches.append(replay.world.memory["touches"].sum((1, 2)))
    for row, episode in enumerate(recording.episodes):
        known = episode.columns["memory.touches"].sum((1, 2))
        own = np.array(touches)[1 : len(episode) + 1, row]
        np.testing.assert_array_equal(own, known)


@pytest.mark.parametrize(
    ("task", "words"),
    [("move_block", "bodies"), ("duel", "table|seats|goal"), ("hit_goal", "path")],
)
def test_tasks_that_the_recording_cannot_serve_are_refused(task, words, tmp_path):
    recording = recorded(tmp_path / "r", "juggle", episodes=1)
    with pytest.raises(ValueError, match=words):
        Replay(recording, ah.make_scenario(task))


def test_episodes_are_replayed_alone_as_together(tmp_path):
    recording = recorded(tmp_path / "r", "juggle", profile="ur5e")
    alone = Recording(recording.path, recording.head, recording.episodes[2:])
    (one,) = Replay(alone).episodes()
    *_, last = Replay(recording).episodes()
    for name, values in one.columns.items():
        assert distance(values, last.columns[name]) <= EXACT, name


def test_relabelled_play_ends_by_the_new_rules(tmp_path):
    recorded(tmp_path / "r", "juggle", episodes=6)
    paths = [
        relabelled(tmp_path / "r", name, tmp_path / name)
        for name in ("touch", "juggle")
    ]
    touch, again = (read_recording(path) for path in paths)
    assert touch.head["scenario"] == "touch"
    assert touch.head["relabelled_from"] == "juggle"
    limit = touch.head["max_cycles"]
    for old, new in zip(again.episodes, touch.episodes, strict=True):
        assert len(new) == min(len(old), limit)
        np.testing.assert_array_equal(
            new.columns["state.position"], old.columns["state.position"][: len(new)]
        )
        ends = new.columns["terminated"] | new.columns["truncated"]
        assert ends[-1]
        assert not ends[:-1].any()
        touched = new.columns["memory.touches"][-1].sum() > 0
        assert new.columns["success"][-1].any() == touched


def test_all_tasks_that_fit_are_relabelled_in_one_command(tmp_path):
    recorded(tmp_path / "juggle", "juggle", 2, options={"table": "full_size"})
    found = fitting(tmp_path / "juggle")
    assert {"juggle", "touch", "puck_velocity"} <= set(found)
    assert not {"reach", "duel", "move_block", "hit_goal"} & set(found)
    out = tmp_path / "out"
    command = ["data", "relabel", str(tmp_path / "juggle"), "--out", str(out)]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert sorted(path.name for path in out.iterdir()) == sorted(found)


def test_check_compares_a_recording_with_its_replay(tmp_path):
    recorded(tmp_path / "r", "juggle")
    done = CliRunner().invoke(app, ["data", "check", "--replay", str(tmp_path / "r")])
    assert done.exit_code == 0, done.output
    assert "replayed, largest difference" in done.output
    part = next((tmp_path / "r" / "steps").iterdir())
    table = pq.ParquetFile(part).read()
    column = table.column_names.index("reward")
    changed = pa.FixedSizeListArray.from_arrays(
        pc.add(table["reward"].combine_chunks().flatten(), 0.5), 1
    )
    pq.write_table(table.set_column(column, "reward", changed), part)
    done = CliRunner().invoke(app, ["data", "check", "--replay", str(tmp_path / "r")])
    assert done.exit_code == 1
    assert "reward differs by 0.5 from the value of" in " ".join(done.output.split())
