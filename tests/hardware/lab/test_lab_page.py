"""A match on the real table, as the page plays it: asked for, counted down, stopped."""

import threading
import time

import cv2
import numpy as np
import pytest

from marl_airhockey.play.client import Client
from marl_airhockey.play.handicap import Handicap
from marl_airhockey.play.open_table import open_table
from marl_airhockey.play.plant import Plant
from marl_airhockey.play.real_match import RealMatch


@pytest.fixture
def match(rig):
    keywords = {
        "backend": "real",
        "rig": str(rig),
        "profile": "ur5e",
        "options": {"table": "full_size"},
    }
    made = RealMatch("juggle", {"paddle_0": "zoo/juggle_full_size"}, keywords, seed=0)
    ended = threading.Event()

    def run():
        while not ended.is_set():
            made.tick()
            time.sleep(0.005)

    thread = threading.Thread(target=run)
    thread.start()
    yield made
    ended.set()
    made.close()
    thread.join()


def wait_for(match, phase, seconds=20.0):
    until = time.monotonic() + seconds
    while match.phase != phase and time.monotonic() < until:
        time.sleep(0.01)
    assert match.phase == phase, match.reason


@pytest.mark.slow
def test_an_episode_begins_stops_and_goes_on_by_word(lab, match, fault):
    time.sleep(0.3)
    assert match.phase == "lobby"
    assert match.backend.robot.state.name == "READY", "nothing moves unasked"
    match.start()
    wait_for(match, "countdown")
    wait_for(match, "play")
    time.sleep(0.5)
    told = match.state()["table"]
    assert told["robot"] == "RUNNING"
    assert told["frame_ms"] < 150
    picture = cv2.imdecode(np.frombuffer(match.picture(), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (480, 640, 3)
    fault("protective_stop")
    wait_for(match, "done")
    assert match.reason == "robot: protective stop"
    match.start()
    wait_for(match, "pause")
    assert "May it continue?" in match.reason
    time.sleep(5.2)
    match.start()
    wait_for(match, "play")
    match.pause()
    assert match.phase == "done"
    time.sleep(0.4)
    assert match.backend.robot.state.name == "READY"


@pytest.mark.slow
def test_who_is_elsewhere_watches_and_nobody_is_erratic(match):
    switched = []
    session = open_table(match)
    session.host.plant = Plant(
        {"dark_camera": "dark"}, lambda *order: switched.append(order)
    )
    away, here = session.connect(remote=True), session.connect()
    assert isinstance(away, Client)
    for client in (away, here):
        session.receive(client, '{"t": "fault", "name": "dark_camera", "on": 1}')
    assert switched == [("dark_camera", True)]
    session.receive(away, '{"t": "start"}')
    assert match.phase == "lobby"
    with pytest.raises(ValueError, match="real arm"):
        match.set_driver(0, "random")
    with pytest.raises(ValueError, match="noise"):
        match.set_driver(0, "juggler", Handicap(noise=0.1))
    described = session.describe()
    assert described["checkpoints"] == [], "no page changes the driver of an arm"
    assert described["camera"]
    assert list(described["faults"]) == ["dark_camera"]


def test_an_arm_moves_only_while_somebody_holds_on(match):
    match.set_driver(0, "person")
    session = open_table(match)
    client = session.connect()
    session.receive(client, '{"t": "hello", "key": "a"}')
    mouse = match.drivers.input_device(0, "mouse")
    aim = '{"t": "aim", "x": -0.6, "y": 0.1, "held": %d, "q": 1, "rtt": 0}'
    session.receive(client, aim % 0)
    assert mouse.target is None
    session.receive(client, aim % 1)
    assert mouse.target == (-0.6, 0.1)
    session.host.seats.rest_unheld(time.monotonic() + 0.2)
    assert mouse.target is not None, "news of it is on its way"
    session.host.seats.rest_unheld(time.monotonic() + 0.4)
    assert mouse.target is None, "no news is let go"
    session.receive(client, aim % 1)
    session.receive(client, aim % 0)
    assert mouse.target is None
