"""Tournaments: pairs, byes, results, absent players, and the table that hosts them."""

import json
import time

import numpy as np
import pytest
from pages import line

from marl_airhockey.play.live_match import LiveMatch
from marl_airhockey.play.seats import Seats
from marl_airhockey.play.session import Session
from marl_airhockey.play.tournament import Tournament
from marl_airhockey.play.tournament_table import PATIENCE, TournamentTable


def with_players(count):
    tournament = Tournament()
    for i in range(count):
        tournament.enter(str(i), f"Player {i}")
    tournament.begin()
    return tournament


@pytest.mark.parametrize("count", range(2, 18))
def test_a_tournament_of_n_players_has_n_minus_one_matches(count):
    tournament, played = with_players(count), 0
    byes = set()
    while tournament.current is not None:
        for pair in tournament.rounds[-1]:
            if len(pair.players) == 1:
                byes.add((len(tournament.rounds), pair.players[0]))
        tournament.finish(played % 2, (3, 1) if played % 2 == 0 else (1, 3))
        played += 1
    assert played == count - 1
    state = tournament.state()
    assert state["champion"] in state["players"]
    assert sum(row["won"] for row in state["table"]) == count - 1
    assert len({key for _, key in byes}) == len(byes), "nobody has two byes"


def test_bad_names_are_named():
    tournament = Tournament()
    tournament.enter("a", "  Ada   L. ")
    assert tournament.names == {"a": "Ada L."}
    for name, words in (("", "1 to 20"), ("x" * 21, "1 to 20"), ("ada l.", "taken")):
        with pytest.raises(ValueError, match=words):
            tournament.enter("b", name)
    tournament.begin()
    assert tournament.rounds == [], "one player is no tournament"


@pytest.fixture
def session():
    options = {"options": {"goals_to_win": 1, "seconds": 5.0}}
    match = LiveMatch("duel", {}, options, seed=1)
    return Session(TournamentTable(Seats(match), None))


def enter(session, key):
    client = session.connect()
    session.receive(client, line("hello", key=key))
    session.receive(client, line("name", text=f"N{key}"))
    return client


def score_for(session, seat):
    """Play until a seat of the pair scores the goal that decides."""
    match = session.match
    while match.phase != "play":
        session.tick()
    state = match.world.state.map(np.copy)
    way = 1.0 if seat == 0 else -1.0
    state.puck[0, 0], state.puck_velocity[0, 0] = (0.7 * way, 0.0), (3.0 * way, 0.0)
    state.paddle[0, 1 - seat] = (0.4 * way, 0.2)
    match.world.set_state(state, match.world.memory)
    while match.phase != "done":
        session.tick()


def test_pairs_sit_in_turn_and_the_winner_goes_on(session):
    clients = [enter(session, str(i)) for i in range(3)]
    assert [client.seat for client in clients] == [None] * 3
    session.receive(clients[0], line("begin"))
    assert [client.seat for client in clients] == [0, 1, None]
    session.receive(clients[2], line("start"))
    assert session.match.phase == "lobby", "only the pair starts"
    session.receive(clients[1], line("start"))
    score_for(session, 1)
    session.tick()
    state = json.loads(clients[2].frame)["tournament"]
    assert state["rounds"][0][1]["winner"] == "N1"
    assert state["current"]["players"] == ["N2", "N1"]
    shown = [seat["title"] for seat in json.loads(clients[2].frame)["seats"]]
    assert shown == ["N0", "N1"], "the result is that of the pair at the table"
    session.receive(clients[2], line("start"))
    assert clients[2].seat is None, "only the pair ends the result"
    session.receive(clients[1], line("start"))
    assert [client.seat for client in clients] == [None, 1, 0]
    session.receive(clients[1], line("start"))
    score_for(session, 0)
    session.tick()
    assert json.loads(clients[0].frame)["tournament"]["champion"] == "N2"


def test_an_absent_player_loses_and_a_reload_keeps_the_seat(session):
    one, other = enter(session, "1"), enter(session, "2")
    session.receive(one, line("begin"))
    session.disconnect(other)
    back = session.connect()
    session.receive(back, line("hello", key="2"))
    assert back.seat == 1
    session.disconnect(back)
    now = time.monotonic()
    session.host.check_presence(now)
    assert session.host.tournament.champion == ""
    session.host.check_presence(now + PATIENCE + 1.0)
    assert session.host.tournament.champion == "1"


def test_a_tournament_needs_a_game_of_two_players():
    with pytest.raises(ValueError, match="two players, not juggle"):
        TournamentTable(Seats(LiveMatch("juggle", {}, {}, seed=1)), None)
