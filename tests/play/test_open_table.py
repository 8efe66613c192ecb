"""An open table: who leaves, who comes, and how results are explained."""

import json
import time

import numpy as np
import pytest
from pages import line

from marl_airhockey.play.host import GONE, GRACE
from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.open_table import open_table


def enter(session, key):
    client = session.connect()
    session.receive(client, line("hello", key=key))
    return client


def begin(session, client):
    session.receive(client, line("start"))
    while session.match.phase == "countdown":
        session.tick()
    for _ in range(20):
        session.tick()
    assert session.match.phase == "play"


def remember(world, **values):
    memory = world.memory
    for name, value in values.items():
        memory[name][0] = value
    world.set_state(world.state, memory)


@pytest.fixture
def table():
    return open_table(LiveMatch("duel", {}, {"options": {"seconds": 30.0}}, seed=1))


def test_whoever_remains_goes_on_against_a_driver_or_ends_the_match(table):
    one, other = enter(table, "1"), enter(table, "2")
    begin(table, one)
    table.disconnect(other)
    assert (table.match.phase, table.match.reason) == ("pause", GONE)
    table.receive(one, line("start"))
    assert table.match.phase == "pause", "nobody plays alone unasked"
    steps = table.match.ticks
    table.receive(one, line("substitute"))
    assert table.match.phase == "countdown"
    assert table.match.drivers.names == ["person", "zoo/duel"]
    while table.match.phase != "play":
        table.tick()
    table.tick()
    assert table.match.ticks == steps + 2, "the same match goes on"
    late = enter(table, "2")
    assert late.seat is None
    table.receive(one, line("pause"))
    table.receive(one, line("stop"))
    assert table.match.phase == "done"


def test_a_waiting_page_is_seated_when_the_reservation_ends(table):
    one, other = enter(table, "1"), enter(table, "2")
    third, fourth = enter(table, "3"), enter(table, "4")
    queue = [table.host.own_fields(page)["queue"] for page in (one, third, fourth)]
    assert queue == [0, 1, 2]
    begin(table, one)
    now = time.monotonic()
    table.disconnect(other)
    table.host.check_presence(now)
    assert third.seat is None, "the seat is reserved for a reload"
    table.host.check_presence(now + GRACE + 1.0)
    assert (third.seat, fourth.seat) == (1, None)
    assert table.match.phase == "lobby"
    table.receive(one, line("leave"))
    assert one.seat is None
    table.host.check_presence(now + GRACE + 2.0)
    assert fourth.seat == 0
    assert table.host.own_fields(one)["queue"] == 0, "it left on purpose"
    table.receive(one, line("join"))
    assert table.host.own_fields(one)["queue"] == 1


def test_a_match_can_be_ended_while_somebody_is_missing(table):
    one, other = enter(table, "1"), enter(table, "2")
    begin(table, one)
    table.receive(other, line("leave"))
    table.receive(one, line("stop"))
    assert table.match.phase == "done"
    assert enter(table, "3").seat == 1
    assert table.match.phase == "lobby", "not somebody else's result"


def test_an_empty_table_is_cleared_and_a_reload_is_not_a_departure(table):
    one, other = enter(table, "1"), enter(table, "2")
    begin(table, one)
    table.disconnect(one)
    table.disconnect(other)
    table.host.check_presence(time.monotonic())
    assert table.match.phase == "pause", "both may only have loaded the page again"
    assert enter(table, "3").seat is None, "for ten seconds the seats are theirs"
    assert enter(table, "1").seat == 0
    assert enter(table, "2").seat == 1
    assert table.match.phase == "countdown"
    for client in list(table.clients):
        table.disconnect(client)
    table.host.check_presence(time.monotonic() + GRACE + 1)
    assert table.match.phase == "lobby"
    assert enter(table, "3").seat == 0
    assert table.match.state()["caption"] == "goals 0 : 0, shots 0 : 0"


def test_who_takes_a_seat_amid_a_match_begins_a_new_one(table):
    one, other = enter(table, "1"), enter(table, "2")
    begin(table, one)
    watcher = enter(table, "3")
    table.receive(other, line("leave"))
    table.receive(watcher, line("sit", seat=1))
    assert watcher.seat == 1
    assert table.match.phase == "lobby"
    begin(table, one)
    table.receive(watcher, line("leave"))
    table.receive(watcher, line("sit", seat=1))
    assert table.match.phase == "pause", "the same person goes on"


def test_a_level_game_names_the_shots_that_decide_it_and_offers_a_golden_goal():
    seats = {"paddle_1": "still"}
    options = {"options": {"seconds": 1.0}}
    session = open_table(LiveMatch("duel", seats, options, seed=1))
    match, client = session.match, enter(session, "1")
    begin(session, client)
    remember(match.world, stopped=(2.0, 1.0))
    while match.phase != "done":
        session.tick()
    state = json.loads(client.frame)
    assert state["caption"] == "goals 0 : 0, shots 2 : 1"
    assert state["decided_by"] == "shots on goal"
    assert state["success"] == [0]
    assert state["offers_golden_goal"]
    session.receive(client, line("golden_goal"))
    assert match.phase == "countdown"
    assert match.keywords["options"] == {"seconds": 1.0, "goals_to_win": 1}
    while match.phase != "play":
        session.tick()
    remember(match.world, goals=(1.0, 0.0))
    session.tick()
    assert match.phase == "done"
    state = json.loads(client.frame)
    assert (state["golden_goal"], state["decided_by"]) == (True, "goals")
    assert not state["offers_golden_goal"]
    session.receive(client, line("opponent", seat=1, name="gentle"))
    assert match.phase == "lobby"
    assert not match.state()["golden_goal"], "the next match has the usual rules"
    assert match.keywords["options"] == {"seconds": 1.0}


def test_lives_or_shots_decide_a_game_of_all():
    match = LiveMatch("free_for_all", {}, {}, seed=0)
    memory = {name: value[0].copy() for name, value in match.world.memory.items()}
    judge = match.world.scenario.decided_by
    assert judge(memory) == ""
    memory["lives"][2] = 1.0
    memory["shots"][:] = 0.0, 3.0, 9.0, 1.0
    assert judge(memory) == "shots on goal"
    memory["lives"][:] = np.array([0.0, 0.0, 2.0, 1.0])
    assert judge(memory) == "lives"
