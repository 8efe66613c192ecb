"""Live matches and the people at them, without a network."""

import json
import time

import numpy as np
import pytest
from pages import aim, line

from marl_airhockey.build import build_world
from marl_airhockey.play.handicap import Handicap, HandicappedDriver
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.seats import IDLE
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.world.driven_seat import DrivenSeat


@pytest.mark.usefixtures("uncompiled")
def test_every_scenario_is_played_and_drawn(scenario):
    match = LiveMatch(scenario, {}, {}, seed=3)
    assert match.drivers.names == ["person"] * len(match.seats)
    match.start()
    for _ in range(4 * RATE):
        match.tick()
    assert match.ticks > 0
    assert json.loads(json.dumps(match.state()))["phase"] in ("play", "done")
    described = json.loads(json.dumps(match.describe()))
    assert len(described["seats"]) == len(match.seats)


def test_a_pointer_moves_its_paddle_and_stays_within_the_limits():
    match = LiveMatch("duel", {"paddle_0": "still"}, {}, seed=1)
    session = open_table(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    assert client.seat == 1
    session.receive(client, aim(0.4, 0.2))
    session.receive(client, line("start"))
    for _ in range(5 * RATE):
        session.tick()
        speed = np.hypot(*match.world.state.paddle_velocity[0, 1])
        assert speed <= match.seats[1].speed + 1e-6
    np.testing.assert_allclose(match.world.state.paddle[0, 1], (0.4, 0.2), atol=0.01)
    session.receive(client, aim(-0.4, 0.0))
    for _ in range(RATE):
        session.tick()
    assert match.world.state.paddle[0, 1, 0] > 0.0, "not into the other's half"
    frame = json.loads(client.frame)
    assert frame["seat"] == 1
    assert frame["ack"] == 1


def test_a_stick_is_a_velocity():
    match = LiveMatch("duel", {"paddle_1": "still"}, {}, seed=1)
    session = open_table(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, line("start"))
    while match.phase != "play":
        session.tick()
    before = match.world.state.paddle[0, 0].copy()
    session.receive(client, line("stick", x=0.0, y=-0.5, q=1, rtt=0))
    for _ in range(6):
        session.tick()
    moved = match.world.state.paddle[0, 0] - before
    assert moved[1] < -0.02
    assert abs(moved[0]) < 1e-9
    session.receive(client, line("stick", x=0.05, y=0.0, q=2, rtt=0))
    for _ in range(20):
        session.tick()
    assert np.hypot(*match.world.state.paddle_velocity[0, 0]) < 1e-6, "dead zone"


def test_two_people_and_a_watcher():
    match = LiveMatch("duel", {}, {}, seed=1)
    session = open_table(match)
    clients = [session.connect() for _ in range(3)]
    for i, client in enumerate(clients):
        session.receive(client, line("hello", key=str(i)))
    assert [client.seat for client in clients] == [0, 1, None]
    watcher = clients[2]
    session.disconnect(clients[1])
    session.receive(clients[0], line("start"))
    assert match.phase == "lobby", "a seat of people is free"
    clients[1] = session.connect()
    session.receive(clients[1], line("hello", key="1"))
    assert clients[1].seat == 1
    for text in (line("start"), line("swap"), aim(0, 0), line("sit", seat=0)):
        session.receive(watcher, text)
    assert match.phase == "lobby"
    assert watcher.seat is None
    session.receive(clients[1], line("start"))
    session.tick()
    assert match.phase == "countdown"
    assert json.loads(watcher.frame)["watching"] == 1
    session.disconnect(clients[0])
    assert match.phase == "pause"
    assert match.reason == "a player has disconnected"
    back = session.connect()
    session.receive(back, line("hello", key="0"))
    assert back.seat == 0, "a page that is loaded again gets its seat back"
    assert match.phase == "countdown"
    session.receive(back, line("pause"))
    session.disconnect(back)
    back = session.connect()
    session.receive(back, line("hello", key="0"))
    assert match.phase == "pause", "who paused goes on when they want"
    session.receive(back, line("stop"))
    assert match.phase == "done"
    session.receive(back, line("swap"))
    assert match.phase == "lobby"


def test_an_idle_page_loses_its_seat():
    session = open_table(LiveMatch("duel", {}, {}, seed=1))
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.host.check_presence(time.monotonic() + IDLE / 2)
    assert client.seat == 0
    session.host.check_presence(time.monotonic() + IDLE + 1)
    assert client.seat is None


def test_opponents_are_chosen_between_matches_and_ends_change():
    match = LiveMatch("duel", {"paddle_1": "zoo/duel"}, {}, seed=1)
    session = open_table(match)
    client = session.connect()
    session.receive(client, line("hello", key="k"))
    session.receive(client, line("opponent", seat=1, name="../secret.zip"))
    assert match.drivers.names[1] == "zoo/duel", "only who is offered may play"
    session.receive(client, line("opponent", seat=1, name="gentle"))
    gentle = match.drivers.ladder[0]
    assert match.drivers.names == ["person", gentle.driver]
    assert match.drivers.handicaps == [Handicap(), gentle.handicap]
    session.receive(client, line("swap"))
    assert match.drivers.names == [gentle.driver, "person"]
    assert match.drivers.handicaps == [gentle.handicap, Handicap()]
    assert client.seat == 1
    session.receive(client, line("start"))
    for _ in range(4 * RATE):
        session.tick()
    session.receive(client, line("opponent", seat=0, name="champion"))
    assert match.drivers.names[0] == gentle.driver, "not during a match"
    with pytest.raises(ValueError, match="unknown driver"):
        LiveMatch("duel", {"paddle_1": "nobody"}, {})
    with pytest.raises(ValueError, match="use person"):
        LiveMatch("duel", {"paddle_1": "mouse"}, {})
    with pytest.raises(ValueError, match="path"):
        LiveMatch("duel", {"paddle_1": "policy"}, {})
    with pytest.raises(ValueError, match="paddle_7"):
        LiveMatch("duel", {"paddle_7": "still"}, {})


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize(
    ("game", "keywords", "fitting"),
    [
        ("duel", {}, ["zoo/duel", *(f"zoo/duel_{k}" for k in (1, 2, 3, 4))]),
        ("duel", {"options": {"pucks": 2}}, []),
        pytest.param(
            "duel",
            {"options": {"seats": "robot", "reaction": 0.0}, "profile": "ur5e"},
            ["zoo/duel_robot"],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *("free_for_all", {"options": {"sides": 3}}, []), marks=pytest.mark.slow
        ),
        ("juggle", {}, ["zoo/juggle", "zoo/juggle_ur5e"]),
        ("juggle", {"profile": "ur5e"}, ["zoo/juggle_ur5e", "zoo/juggle"]),
        ("juggle", {"options": {"table": "full_size"}}, ["zoo/juggle_full_size"]),
    ],
)
def test_policies_that_fit_are_offered(game, keywords, fitting):
    match = LiveMatch(game, {}, keywords, seed=0)
    assert match.drivers.fitting_policies == fitting
    for level in match.drivers.ladder:
        match.set_driver(0, level.driver, level.handicap)
        assert match.drivers.level(0) == level.name
    if not fitting:
        with pytest.raises(ValueError, match="expects observations"):
            match.set_driver(0, f"zoo/{game}")
        assert match.drivers.level(0) == level.name, "who sat there still does"


def test_a_match_ends_and_another_begins():
    options = {"options": {"seconds": 2.0}}
    match = LiveMatch("duel", {"paddle_0": "striker", "paddle_1": "still"}, options)
    for _ in range(2):
        match.start()
        while match.phase != "done":
            match.tick()
        assert match.ticks == 2 * RATE
    assert match.world.episode.number[0] == 2


def test_a_warm_up_leaves_no_trace():
    fresh = LiveMatch(
        "duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {}, seed=4
    )
    other = LiveMatch(
        "duel", {"paddle_0": "striker", "paddle_1": "zoo/duel"}, {}, seed=4
    )
    other.warm_up()
    for match in (fresh, other):
        match.start()
        for _ in range(6 * RATE):
            match.tick()
    assert fresh.state() == other.state()
    assert fresh.number == other.number == 1


def test_a_handicap_limits_the_speed():
    def fastest(handicap):
        seats = {"paddle_0": "striker", "paddle_1": "still"}
        match = LiveMatch("duel", seats, {}, handicap, seed=2)
        match.start()
        speeds = []
        for _ in range(6 * RATE):
            match.tick()
            speeds.append(np.hypot(*match.world.state.paddle_velocity[0, 0]))
        return max(speeds)

    assert fastest(Handicap(pace=0.3)) <= 0.3 * 5.0 + 1e-6 < fastest(Handicap())
    with pytest.raises(ValueError, match="reaction"):
        Handicap(reaction=2.0)


class Notes(Driver):
    """Driver that notes the puck and the own paddle that it observes."""

    observe, control_dt, needs_goal = "velocity", 0.05, False

    def __init__(self):
        self.seen, self.read = [], []

    def act(self, view, memory):
        self.seen.append(np.hstack([view.state.puck[0, 0], view.state.paddle[0, 1]]))
        labels = ("puck_0.x", "puck_0.y", "own.x", "own.y")
        self.read.append(view.observation[0, [view.labels.index(n) for n in labels]])
        return np.tile((0.3, 0.1), (len(view.state.puck), 1)), memory


def test_a_handicapped_driver_observes_the_puck_late_and_its_own_paddle_now():
    def notes(handicap):
        own = Notes()
        world = build_world("duel", 1, False, {}, ["velocity"])
        seat = DrivenSeat(
            1, HandicappedDriver(own, handicap), world.observer, 1, world.control_dt
        )
        world.reset(3)
        seat.reset(np.zeros(1, int), world.seeds, world.episode.number)
        for _ in range(30):
            action = np.zeros((1, 2, 2))
            action[:, 1] = seat.act(world.known)
            world.step(action)
        return np.array(own.seen), np.array(own.read)

    plain, late = notes(Handicap()), notes(Handicap(reaction=0.1))
    for now, then in zip(plain, late, strict=True):
        np.testing.assert_allclose(then[2:, :2], now[:-2, :2], atol=1e-6)
        np.testing.assert_allclose(then[:, 2:], now[:, 2:], atol=1e-6)
    noisy = notes(Handicap(noise=0.02))
    error = noisy[0][:, :2] - plain[0][:, :2]
    assert 0.002 < np.abs(error).mean() < 0.06
    np.testing.assert_allclose(noisy[0], noisy[1], atol=1e-6)
