"""Recordings of play: what is written, refused, filmed and summed up."""

import json
import time

import numpy as np
import pytest
from pages import aim, line
from PIL import Image

from marl_airhockey.data.reader import read_recording
from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.measures import interceptions
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.plots import plot_report
from marl_airhockey.play.protocol import RateLimiter
from marl_airhockey.play.recorder import Recorder
from marl_airhockey.play.replay import one_episode, replay_of
from marl_airhockey.play.report import summarize
from marl_airhockey.rollouts.replay import Replay
from marl_airhockey.rollouts.watch import write_replay

DEVICE = {"input": "mouse", "width": 1000, "height": 600, "density": 2.0, "hz": 60.0}


def test_an_episode_is_recorded_step_by_step(tmp_path):
    options = {"options": {"seconds": 2.0}, "backend": "numba"}
    match = LiveMatch("duel", {"paddle_1": "striker"}, options, seed=5)
    session = open_table(match, Recorder(tmp_path))
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, line("device", **DEVICE))
    session.receive(client, aim(-0.3, 0.1))
    session.receive(client, line("start"))
    while match.phase != "done":
        session.tick()
    (path,) = tmp_path.iterdir()
    recording = read_recording(path)
    assert recording.head["players"][0] == {
        "seat": 0,
        "driver": "person",
        "handicap": vars(Handicap()),
        "person": client.name,
        "consent": None,
    }
    (episode,) = recording.episodes
    assert episode.physics["tilt"] == 0.0
    assert episode.reason == "played to the end"
    assert len(episode) == 2 * RATE
    assert {"action", "command", "clock", "round_trip"} <= episode.columns.keys()
    pointer = episode.columns["pointer"]
    np.testing.assert_array_equal(pointer[-1], [(-0.3, 0.1), (np.nan, np.nan)])
    digest, none = recording.head["policies"]
    assert (digest, none) == ("", "")
    assert recording.head["devices"] == [DEVICE, None]
    end = episode.columns["state.position"][-1]
    np.testing.assert_array_equal(end, match.world.state.position[0])
    write_replay(Replay(one_episode(path)), tmp_path / "game.gif")
    with Image.open(tmp_path / "game.gif") as video:
        assert video.n_frames == RATE


def test_a_replay_is_what_the_page_was_shown(tmp_path):
    options = {"options": {"seconds": 2.0}, "backend": "numba"}
    seats = {"paddle_0": "allround", "paddle_1": "striker"}
    match = LiveMatch("duel", seats, options, seed=5)
    session = open_table(match, Recorder(tmp_path))
    match.start()
    shown = []
    while match.phase != "done":
        session.tick()
        if match.ticks > len(shown):
            shown.append(match.state())
    (path,) = tmp_path.iterdir()
    replayed = replay_of(path)
    assert replayed["meta"]["match"] == match.describe()
    steps = replayed["steps"]
    assert len(steps) == len(shown) + 1
    assert any(step["events"] for step in shown)
    for was, now in zip(shown[:-1], steps[1:-1], strict=True):
        assert was == now


def test_recordings_become_a_report(tmp_path):
    for seed in range(3):
        seats = {"paddle_0": "person", "paddle_1": "striker:strength=fair"}
        options = {"options": {"seconds": 6.0}}
        match = LiveMatch("duel", seats, options, seed=seed)
        session = open_table(match, Recorder(tmp_path))
        client = session.connect()
        session.receive(client, line("hello", key="alice"))
        session.receive(client, line("start"))
        while match.phase != "done":
            _, y = match.world.state.puck[0, 0]
            client.limiter = RateLimiter(time.monotonic())
            session.receive(client, aim(-0.6, float(y)))
            session.tick()
    match.start()
    for _ in range(4 * RATE):
        session.tick()
    session.host.recorder.end(match, "a player has left")
    found = summarize(tmp_path)
    assert found.episodes == 4
    assert found.broken_off == 1
    person = found.players[client.name]
    assert person.person
    assert person.games == 3 == found.players["striker:strength=fair"].games
    assert sum(len(game.pairs) for game in found.games) == 3
    assert person.steps > 3 * 6 * RATE
    assert found.players["striker:strength=fair"].shot_speeds
    files = found.save(tmp_path / "out")
    files.append(tmp_path / "out" / "report.png")
    plot_report(found, files[-1])
    assert all(path.stat().st_size > 100 for path in files)
    data = json.loads(files[0].read_text())
    assert {row["player"] for row in data["players"]} == set(found.players)
    with pytest.raises(ValueError, match="no recordings"):
        summarize(tmp_path / "out")


def test_interceptions_are_measured_right():
    n, dt = 120, 1 / RATE
    place = np.zeros((n, 2))
    place[:20] = (0.8, 0.0)
    place[20:, 0] = -0.5 * dt * np.arange(n - 20)
    motion = np.zeros((n, 2))
    motion[20:, 0] = -0.5
    hits = np.zeros(n, bool)
    hits[90] = True
    motion[90:, 0] = 1.0
    assert list(interceptions(place, motion, hits)) == [True]
    assert list(interceptions(place, motion, hits & False)) == [False]


def test_a_match_whose_players_change_does_not_count(tmp_path):
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    session = open_table(match, Recorder(tmp_path))
    first = session.connect()
    session.receive(first, line("hello", key="a"))
    session.receive(first, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    session.receive(first, line("leave"))
    second = session.connect()
    session.receive(second, line("hello", key="b"))
    session.receive(second, line("start"))
    for _ in range(5 * RATE):
        session.tick()
    first, second = sorted(tmp_path.iterdir())
    (episode,) = read_recording(first).episodes
    assert episode.reason == "the players changed"
    session.host.recorder.end(match, "enough")
    (episode,) = read_recording(second).episodes
    assert episode.reason == "enough"
