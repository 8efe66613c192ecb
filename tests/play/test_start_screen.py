"""Between matches: the demonstration, the menu of games, goals, results, insight."""

import json
import time

import cv2
import numpy as np
import pytest
from pages import line

from marl_airhockey.play.game_menu import GameMenu
from marl_airhockey.play.invitation import code_of, in_terminal, rows_of
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import GOAL_STOP, open_table


def enter(session, key="k"):
    client = session.connect()
    session.receive(client, line("hello", key=key))
    return client


def frame_of(session, client):
    session.tick()
    return json.loads(client.frame)


def test_policies_play_behind_the_start_screen_and_leave_the_match_alone():
    alone = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    session = open_table(match)
    client = enter(session)
    session.tick()
    first = frame_of(session, client)["demo"]
    for _ in range(RATE):
        state = frame_of(session, client)
    assert state["demo"]["n"] == first["n"] + RATE
    assert state["demo"]["pucks"] != first["pucks"]
    assert match.ticks == 0
    session.receive(client, line("start"))
    assert "demo" not in frame_of(session, client)
    alone.start()
    alone.tick()
    for _ in range(5 * RATE):
        alone.tick()
        session.tick()
    np.testing.assert_array_equal(match.world.state.puck, alone.world.state.puck)


def test_another_game_is_prepared_while_the_pages_keep_their_seats():
    def prepare(name):
        match = LiveMatch(name, {}, {}, seed=2)
        for i in range(1, len(match.seats)):
            match.set_driver(i, "still")
        return match

    match = LiveMatch("duel", {}, {}, seed=1)
    session = open_table(match, menu=GameMenu(["duel", "reach"], prepare))
    one, other = enter(session, "1"), enter(session, "2")
    edition = session.host.edition
    session.receive(one, line("game", name="../secret"))
    assert frame_of(session, one)["opening"] == ""
    session.receive(one, line("game", name="reach"))
    until = time.monotonic() + 30.0
    while session.match is match:
        assert frame_of(session, one)["opening"] in ("reach", "")
        assert time.monotonic() < until
    assert session.describe()["scenario"] == "reach"
    assert session.host.edition == edition + 1
    assert (one.seat, other.seat) == (0, None)
    assert session.host.own_fields(other)["queue"] == 1
    session.host.close()


def test_a_goal_stops_play_and_every_frame_has_its_events():
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    match.goal_stop = GOAL_STOP
    session = open_table(match)
    client = enter(session)
    session.receive(client, line("start"))
    while match.phase != "play":
        session.tick()
    state = match.world.state.map(np.copy)
    state.puck[0, 0], state.puck_velocity[0, 0] = (0.7, 0.0), (3.0, 0.0)
    state.paddle[0, 1] = (0.4, 0.2)
    match.world.set_state(state, match.world.memory)
    client.events = []
    for _ in range(20):
        session.tick()
    assert match.phase == "goal"
    # No frame was sent meanwhile, so the goal is still in the newest one.
    assert [kind for kind, *_ in json.loads(client.frame)["events"]] == ["goal"]
    steps = match.ticks
    for _ in range(round(GOAL_STOP * RATE)):
        session.tick()
    assert match.phase == "play"
    assert match.ticks <= steps + 20
    session.receive(client, line("stop"))
    tally = frame_of(session, client)["tally"]
    assert tally["scores"] == tally["streak"] == [1, 0]


def test_a_stop_is_skipped_by_a_player():
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    match.start()
    match.phase, match.time_left = "goal", GOAL_STOP
    match.start()
    assert (match.phase, match.time_left) == ("play", 0.0)


def test_a_stage_of_training_replaces_a_driver_in_a_match():
    match = LiveMatch("duel", {"paddle_1": "zoo/duel"}, {}, seed=1)
    session = open_table(match)
    client, watcher = enter(session, "1"), enter(session, "2")
    stages = session.describe()["checkpoints"]
    assert [stage["name"] for stage in stages][-1] == "zoo/duel"
    session.receive(client, line("insight", on=1))
    session.receive(client, line("start"))
    for _ in range(4 * RATE):
        session.tick()
    insight = json.loads(client.frame)["insight"]
    assert insight["seat"] == 1
    late = np.array(insight["seen"]) - match.world.state.puck[0]
    assert 0.0 < np.abs(late).max() < 1.0
    assert 0.0 < insight["next_goal"] < 1.0
    session.receive(watcher, line("checkpoint", seat=1, name="zoo/duel_1"))
    assert match.drivers.names[1] == "zoo/duel"
    session.receive(client, line("checkpoint", seat=1, name="../secret"))
    assert match.drivers.names[1] == "zoo/duel"
    session.receive(client, line("checkpoint", seat=1, name="zoo/duel_1"))
    assert match.drivers.names[1] == "zoo/duel_1"
    assert frame_of(session, client)["mixed"]


@pytest.mark.parametrize("text", ["http://192.168.1.20:8480/?token=abcdefgh12345678"])
def test_the_code_of_an_address_is_read_by_a_camera(text):
    code = code_of(text)
    image = np.where(code, 0, 255).astype(np.uint8)
    image = cv2.resize(image, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    assert cv2.QRCodeDetector().detectAndDecode(image)[0] == text
    assert len(rows_of(code)) == len(code)
    assert {len(row) for row in in_terminal(code).splitlines()} == {len(code)}
