"""Agent ur5e with a policy: an emulated arm plays a seat of a simulated table."""

import numpy as np
import pytest
from emulators import ADDRESS, emulator, status, switch

import marl_airhockey as ah
from marl_airhockey.hardware.robot.nominal import nominal_mounting
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.table import TABLES

TWIN = f"ur5e:host={ADDRESS},policy=zoo/reach_ur5e"


@pytest.mark.slow
def test_the_arm_does_what_the_policy_says_and_the_paddle_follows_it():
    pytest.importorskip("rtde_control")
    with emulator():
        world = ah.make_world("reach", 1, drivers={"paddle_0": TWIN}, profile="ur5e")
        world.reset(0)
        to_table = nominal_mounting(TABLES["standard"]).to_table
        arm, off = [], []
        for _ in range(60):
            world.step(np.zeros((1, 0, 2)))
            arm.append(to_table(np.array(status()["pose"]))[:2])
            off.append(np.linalg.norm(arm[-1] - world.state.paddle[0, 0]))
        assert np.ptp(arm, 0).max() > 0.1
        assert np.median(off) < 0.03
        switch("protective_stop", "--address", ADDRESS)
        with pytest.raises(RuntimeError, match="protective stop"):
            step_often(world)
        world.close()


def step_often(world):
    for _ in range(100):
        world.step(np.zeros((1, 0, 2)))


@pytest.mark.parametrize(
    ("player", "reason"),
    [
        ("ur5e", "expected either a controller"),
        ("ur5e:host=10.1.2.3,policy=still", "may be a real arm"),
        (f"ur5e:host={ADDRESS},policy=nobody", "unknown driver 'nobody'"),
    ],
)
def test_bad_input_is_named(player, reason):
    with pytest.raises(ValueError, match=reason):
        make_driver(player)


def test_a_seat_that_is_no_robots_is_refused():
    twin = f"ur5e:host={ADDRESS},policy=sticky"
    drivers = {"paddle_0": twin, "paddle_1": "still"}
    with pytest.raises(ValueError, match="not the seat of a robot"):
        ah.make_world("duel", 1, drivers=drivers).reset(0)


def test_its_environment_is_that_of_the_policy():
    assert make_driver(TWIN).trained_in["profile"] == "ur5e"
