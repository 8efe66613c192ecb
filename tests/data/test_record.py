"""Episodes of a driver as a recording: all of it is what the world was and did."""

import json

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.core.recording import read_recording
from marl_airhockey.data.columns import memories_of, scenario_of, states_of
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.summary import summarize_recording
from marl_airhockey.world.build import build_driven_world


def record(tmp_path, agent, scenario, episodes=3, **keywords):
    driver = ah.make_agent(agent)
    return record_episodes(driver, agent, scenario, episodes, tmp_path, 7, keywords)


@pytest.mark.parametrize("profile", ["ideal", "ur5e"])
def test_an_episode_is_what_a_world_with_its_seed_does(tmp_path, profile):
    keywords = {"profile": profile, "observe": "history"}
    recording = read_recording(record(tmp_path, "striker", "juggle", **keywords))
    scenario = scenario_of(recording)
    world = build_driven_world(ah.make_agent("striker"), "juggle", 1, keywords)
    for k, episode in enumerate(recording.episodes):
        assert episode.notes["seed"] == 7 + k
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
        assert episode.end["steps"] == len(episode)
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
    whole = path.read_bytes()
    path.write_bytes(whole[: 2 * len(whole) // 3])
    summary = summarize_recording(path)
    assert summary.episodes < 5 or summary.cut_off == 1


def test_what_does_not_fit_the_scenario_is_named(tmp_path):
    path = record(tmp_path, "still", "touch", 1)
    text = path.read_bytes()
    path.write_bytes(text.replace(b'"scenario":"touch"', b'"scenario":"reach"', 1))
    with pytest.raises(ValueError, match="recorded by another version"):
        scenario_of(read_recording(path))
    path.write_bytes(text.replace(b'"scenario":"touch"', b'"scenario":"tooch"', 1))
    with pytest.raises(ValueError, match=rf"{path.name}: .*'tooch'"):
        scenario_of(read_recording(path))


def test_an_interrupted_recording_keeps_what_was_played(tmp_path, monkeypatch):
    driver, reach = ah.make_agent("still"), ah.make_scenario("reach")
    calls, steps = [], round(reach.seconds / 0.05)

    def act(view, memory):
        calls.append(1)
        if len(calls) > 2.5 * steps:
            raise KeyboardInterrupt
        return np.zeros((len(view.rng), 2)), memory

    monkeypatch.setattr(driver, "act", act)
    monkeypatch.setattr("marl_airhockey.data.record.AT_ONCE", 1)
    with pytest.raises(KeyboardInterrupt):
        record_episodes(driver, "still", "reach", 3, tmp_path, 0, {})
    (path,) = tmp_path.iterdir()
    assert path.name.endswith(".rec.part")
    assert len(read_recording(path).episodes) == 2
