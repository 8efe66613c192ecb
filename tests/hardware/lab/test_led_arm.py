"""Agent ur5e: an arm that somebody leads plays a seat on a simulated table."""

import copy
import time
from contextlib import closing

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.lab import LabClient, served


def play(rig, steps, check=lambda world: None):
    drivers = {"paddle_0": f"ur5e:rig={rig}", "paddle_1": "still"}
    world = ah.make_world("duel", 2, drivers=drivers, options={"table": "full_size"})
    try:
        world.reset(0)
        for _ in range(steps):
            world.step(np.zeros((2, 0, 2)))
        check(world)
        return world.state.paddle[:, 0].copy()
    finally:
        world.close()


def step_on(world):
    for _ in range(100_000):
        world.step(np.zeros((2, 0, 2)))


def place_of_arm(lab, place):
    lab.ask({"do": "guide", "place": place})
    for _ in range(400):
        now = lab.ask({"do": "truth"})["paddle"][:2]
        if np.linalg.norm(np.subtract(now, place)) < 1e-3:
            return
        time.sleep(0.01)
    raise AssertionError(f"the arm did not come to {place}, it is at {now}")


@pytest.mark.slow
def test_wherever_the_arm_stands_its_paddle_is_clicked(lab):
    with served(lab, announce=False) as port, closing(LabClient(port)) as client:
        for place in ([-0.69, 0.3], [-0.69, -0.3], [-0.3, 0.2]):
            place_of_arm(lab, place)
            rig = calibrate_lab(client)
            # It is green.
            assert abs(rig.paddle.hue - 60) < 10, place


@pytest.mark.slow
def test_the_paddle_is_where_the_arm_is(lab, rig):
    for place in ([-0.5, 0.1], [-0.6, -0.1]):
        place_of_arm(lab, place)
        off = play(rig, 10) - place
        assert np.abs(off).max() < 0.003


@pytest.mark.slow
def test_copies_have_readers_of_their_own(lab, rig):
    def check(world):
        twin = copy.deepcopy(world)
        twin.step(np.zeros((2, 0, 2)))
        twin.close()
        world.step(np.zeros((2, 0, 2)))

    play(rig, 1, check)


@pytest.mark.slow
def test_a_silent_arm_is_an_error(lab, rig, fault):
    def check(world):
        fault("silent_robot")
        with pytest.raises(RuntimeError, match="no message for"):
            step_on(world)

    play(rig, 1, check)


def test_a_missing_rig_is_named():
    with pytest.raises(ValueError, match=r"nowhere\.json: the file does not exist"):
        play("nowhere.json", 1)
