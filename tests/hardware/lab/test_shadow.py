"""Agent shadow: a hand under the lab's second camera leads an arm, or is a paddle."""

import copy
import time

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.hardware.calibration.lab_rig import calibrate_hand
from marl_airhockey.hardware.hand import Hand
from marl_airhockey.hardware.hand_rig import HandRig
from marl_airhockey.hardware.lab.lab import LabClient, served
from marl_airhockey.hardware.rig import Rig

ROUND = {"do": "hand", "middle": [0.0, 0.0], "amplitude": [0.08, 0.12], "period": 2.0}
STILL = {"do": "hand", "middle": [0.05, -0.1]}
AWAY = {"do": "hand", "away": True}


@pytest.fixture(scope="module")
def hand(lab, tmp_path_factory):
    """The file of the hand's rig, calibrated by what its camera shows."""
    path = tmp_path_factory.mktemp("hand") / "hand.json"
    with served(lab, announce=False) as port:
        client = LabClient(port)
        calibrate_hand(client).save(path)
        client.close()
    return path


@pytest.mark.slow
def test_the_hand_is_where_it_is(lab, hand):
    with Hand(HandRig.load(hand)) as seen:
        for order, far, fast in ((STILL, 0.002, 0.05), (ROUND, 0.012, 0.15)):
            lab.ask(order)
            time.sleep(0.5)
            off, rate = [], []
            for _ in range(40):
                truth, motion = lab.ask({"do": "hand_camera"}), seen.read()
                later = time.monotonic() - truth["time"]
                place = np.add(truth["place"], later * np.array(truth["velocity"]))
                off.append(np.linalg.norm(motion.place - place))
                rate.append(np.linalg.norm(motion.velocity - truth["velocity"]))
                time.sleep(0.02)
            assert np.median(off) < far
            assert np.median(rate) < fast
        lab.ask(AWAY)
        time.sleep(0.6)
        assert seen.read() is None
        assert "not in the image" in seen.trouble


def play(agent, steps, check=lambda world, k: None):
    drivers = {"paddle_0": agent, "paddle_1": "still"}
    world = ah.make_world("duel", 2, drivers=drivers, control_dt=0.05)
    try:
        world.reset(0)
        for k in range(steps):
            time.sleep(0.05)
            world.step(np.zeros((2, 0, 2)))
            check(world, k)
        return world.state.paddle[:, 0].copy()
    finally:
        world.close()


@pytest.mark.slow
def test_a_hand_is_a_paddle_or_leads_one(lab, hand):
    lab.ask(STILL)
    time.sleep(0.3)
    # The field is stretched over the reach: its own half less a radius, all around.
    scene = ah.make_world("duel", 1).scene
    reach = np.array(scene.seats[0].reach)
    low, high = reach.min(0), reach.max(0)
    wanted = (low + high) / 2 + (high - low) / (0.5, 0.6) * STILL["middle"]
    there = play(f"shadow:rig={hand},prescribe=true", 8)
    assert np.abs(there - wanted).max() < 0.006
    # One that leads has to be caught first: from where the paddle rests.
    far = play(f"shadow:rig={hand}", 8)
    assert np.linalg.norm(far - wanted, axis=1).min() > 0.05, "it leapt to the hand"


@pytest.mark.slow
def test_a_hand_that_leaves_lets_the_paddle_rest(lab, hand):
    lab.ask(ROUND)
    moved = []

    def check(world, k):
        if k == 5:
            lab.ask(AWAY)
        moved.append(world.state.paddle[0, 0].copy())

    play(f"shadow:rig={hand},prescribe=true", 20, check)
    ways = np.linalg.norm(np.diff(moved, axis=0), axis=1)
    assert ways[:5].max() > 0.01
    assert ways[-5:].max() < 1e-6


@pytest.mark.slow
def test_copies_have_cameras_of_their_own(lab, hand):
    lab.ask(STILL)
    driver = ah.make_driver(f"shadow:rig={hand},prescribe=true")
    with driver:
        time.sleep(0.3)
        twin = copy.deepcopy(driver)
        first = driver.measured()
        twin.measured()
        time.sleep(0.3)
        scene = ah.make_world("duel", 1).scene
        for each in (driver, twin):
            each.reset(scene.seats[0], None, 1)
        assert np.isfinite(first).all()
        assert np.abs(twin.measured() - driver.measured())[:, :2].max() < 0.01
        twin.__exit__(None, None, None)


@pytest.mark.slow
def test_another_rig_and_a_moved_camera_are_named(lab, hand, rig, tmp_path):
    with pytest.raises(
        ValueError, match="the rig of a table, expected the rig of a hand"
    ):
        ah.make_driver(f"shadow:rig={rig}")
    with pytest.raises(
        ValueError, match="the rig of a hand, expected the rig of a table"
    ):
        Rig.load(hand)
    with pytest.raises(ValueError, match="calibrate --hand"):
        ah.make_driver(f"shadow:rig={tmp_path / 'none.json'}")
    other = HandRig.load(hand)
    tags = {k: np.add(four, 0.03).tolist() for k, four in other.tags.items()}
    other = HandRig(**{**vars(other), "tags": tags})
    other.save(tmp_path / "moved.json")
    with pytest.raises(RuntimeError, match="mm from where they were"):
        ah.make_driver(f"shadow:rig={tmp_path / 'moved.json'}").__enter__()
