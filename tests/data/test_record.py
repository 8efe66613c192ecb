"""Episodes of a driver as a recording: all of it is what the world was and did."""

import json

import numpy as np
import pytest
from pyarrow import parquet as pq

import marl_airhockey as ah
from marl_airhockey.build import build_driven_world
from marl_airhockey.data.derived import divided, merged
from marl_airhockey.data.files import recordings_in
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.summary import summarize_recording
from marl_airhockey.rollouts.columns import memories_of, scenario_of, states_of


def record(tmp_path, agent, scenario, episodes=3, **keywords):
    driver = ah.make_driver(agent)
    path = tmp_path / "recording"
    return record_episodes(driver, agent, scenario, episodes, path, 7, keywords)


@pytest.mark.parametrize("profile", ["ideal", "ur5e"])
def test_an_episode_is_what_a_world_with_its_seed_does(tmp_path, profile):
    keywords = {"profile": profile, "observe": "history"}
    recording = read_recording(record(tmp_path, "striker", "juggle", **keywords))
    scenario = scenario_of(recording)
    world = build_driven_world(ah.make_driver("striker"), "juggle", 1, keywords)
    for k, episode in enumerate(recording.episodes):
        assert episode.seed == 7 + k
        world.reset(7 + k)
        states = states_of(episode, scenario)
        np.testing.assert_array_equal(states.position[0], world.state.position[0])
        for n in range(len(episode)):
            result = world.step(np.zeros((1, 0, 2)))
            row = {name: value[n] for name, value in episode.columns.items()}
            now = states.map(lambda x, n=n: x[n + 1])
            for name in ("position", "velocity", "spin", "touched", "banked", "time"):
                value = getattr(world.state, name)[0]
                np.testing.assert_array_equal(getattr(now, name), value)
            np.testing.assert_array_equal(
                row["observation"], world.observe(np.array([0]))[0]
            )
            np.testing.assert_array_equal(row["action"], world.requested[0])
            np.testing.assert_array_equal(row["command"], world.command[0])
            assert row["returns"] == world.episode.returns[0]
            if profile == "ur5e":
                sensed = world.sensed.position[0]
                np.testing.assert_array_equal(row["sensed.position"], sensed)
        assert result.terminated[0] or result.truncated[0]
        assert episode.reason == "played to the end"
    world.close()


@pytest.mark.usefixtures("uncompiled")
def test_terms_add_up_to_rewards_and_rewards_to_returns(tmp_path, scenario):
    keywords = {"max_cycles": 60}
    if len(ah.make_scenario(scenario).scene.seats) > 1:
        seats = range(1, len(ah.make_scenario(scenario).scene.seats))
        keywords["drivers"] = {f"paddle_{i}": "still" for i in seats}
    recording = read_recording(record(tmp_path, "allround", scenario, 2, **keywords))
    kind = scenario_of(recording)
    for episode in recording.episodes:
        columns = episode.columns
        terms = sum(v for name, v in columns.items() if name.startswith("term."))
        np.testing.assert_allclose(terms, columns["reward"], atol=1e-6)
        np.testing.assert_allclose(
            columns["reward"].astype(float).cumsum(0), columns["returns"], atol=1e-3
        )
        last = {name: value[-1] for name, value in memories_of(episode).items()}
        state = states_of(episode, kind).map(lambda x: x[-1])
        assert isinstance(kind.marks(state, last), list)


def test_it_is_summed_up(tmp_path):
    path = record(tmp_path, "zoo/reach", "reach", 5)
    summary = summarize_recording(path)
    assert summary.episodes == 5
    assert summary.success == 1.0
    assert summary.players == ["zoo/reach"]
    assert summary.cut_off == 0
    json.dumps(summary.to_json(), allow_nan=False)
    files = sorted(file.name for file in path.rglob("*") if file.is_file())
    assert files == ["episodes.parquet", "meta.json", "part-00000.parquet"]
    assert summary.bytes == sum(f.stat().st_size for f in path.rglob("*.*"))


def test_what_does_not_fit_the_scenario_is_named(tmp_path):
    path = record(tmp_path, "still", "touch", 1)
    meta = path / "meta.json"
    text = meta.read_text()
    meta.write_text(text.replace('"touch"', '"reach"', 1))
    with pytest.raises(ValueError, match="recorded by another version"):
        scenario_of(read_recording(path))
    meta.write_text(text.replace('"touch"', '"tooch"', 1))
    with pytest.raises(ValueError, match=rf"{path.name}: .*'tooch'"):
        scenario_of(read_recording(path))


def test_an_interrupted_recording_is_gone_on_with(tmp_path, monkeypatch):
    driver, reach = ah.make_driver("still"), ah.make_scenario("reach")
    calls, steps = [], round(reach.seconds / 0.05)
    act = driver.act

    def stop(view, memory):
        calls.append(1)
        if len(calls) > 2.5 * steps:
            raise KeyboardInterrupt
        return act(view, memory)

    monkeypatch.setattr("marl_airhockey.data.record.AT_ONCE", 1)
    path, whole = tmp_path / "a", tmp_path / "b"
    monkeypatch.setattr(driver, "act", stop)
    with pytest.raises(KeyboardInterrupt):
        record_episodes(driver, "still", "reach", 4, path, 5, {})
    assert len(read_recording(path).episodes) == 2
    monkeypatch.setattr(driver, "act", act)
    done = []
    record_episodes(driver, "still", "reach", 4, path, 5, {}, progress=done.append)
    assert done == [2, 3, 4]
    record_episodes(driver, "still", "reach", 4, whole, 5, {})
    pairs = zip(
        read_recording(path).episodes, read_recording(whole).episodes, strict=True
    )
    for one, other in pairs:
        assert one.seed == other.seed
        for name, value in one.columns.items():
            np.testing.assert_array_equal(value, other.columns[name])


def test_steps_that_lack_after_a_kill_are_played_again(tmp_path):
    path = record(tmp_path, "still", "touch", 3)
    whole = read_recording(path)
    (part,) = (path / "steps").iterdir()
    table = pq.ParquetFile(part).read()
    pq.write_table(table.slice(0, len(table) - 7), part)
    assert [e.reason != "" for e in read_recording(path).episodes] == [1, 1, 0]
    record(tmp_path, "still", "touch", 3)
    for one, other in zip(read_recording(path).episodes, whole.episodes, strict=True):
        assert other.reason == one.reason == "played to the end"
        np.testing.assert_array_equal(other.columns["reward"], one.columns["reward"])


def test_a_folder_of_something_else_is_refused(tmp_path):
    record(tmp_path, "still", "touch", 1)
    with pytest.raises(ValueError, match="scenario 'touch', not 'reach'"):
        record(tmp_path, "still", "reach", 1)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("mine")
    driver = ah.make_driver("still")
    with pytest.raises(ValueError, match="contains other files"):
        record_episodes(driver, "still", "touch", 1, tmp_path / "other", 7, {})


def test_recordings_are_divided_and_merged(tmp_path):
    path = record(tmp_path, "still", "touch", 10)
    parts = divided(path, tmp_path / "parts", 0.3, seed=0)
    seeds = [[e.seed for e in read_recording(part).episodes] for part in parts]
    assert [len(own) for own in seeds] == [7, 3]
    assert sorted(seeds[0] + seeds[1]) == list(range(7, 17))
    merged(parts, tmp_path / "whole")
    with pytest.raises(ValueError, match="given twice"):
        recordings_in([path, tmp_path / "parts", path])
    again = read_recording(tmp_path / "whole").episodes
    assert [e.seed for e in again] == seeds[0] + seeds[1]
    with pytest.raises(ValueError, match="at least one episode for train"):
        divided(path, tmp_path / "none", 0.0, seed=0)
    merged([path, record(tmp_path / "b", "random", "touch", 1)], tmp_path / "two")
    assert read_recording(tmp_path / "two").head["players"] == [
        {"driver": "still + random", "person": None}
    ]
    with pytest.raises(ValueError, match="it already has 10 episodes"):
        record(tmp_path, "still", "touch", 3)
    other = record(tmp_path / "more", "still", "reach", 1)
    with pytest.raises(ValueError, match="scenario is 'reach'"):
        merged([path, other], tmp_path / "both")
