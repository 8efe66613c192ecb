"""An arm that follows later than usual is sent slower, held, and never leaps."""

import numpy as np
import pytest
from helpers.driven import STEP, drive, moving_robot

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.robot import DriverState, Fault

LIMIT = 0.7


def wander(robot, rng, seconds):
    """Command the speed limit in random directions; return the largest true speed."""
    top, velocity = 0.0, np.zeros(2)
    for _ in range(round(seconds / STEP)):
        if rng.random() < 0.3:
            angle = rng.uniform(0.0, 2 * np.pi)
            velocity = 2.0 * np.array([np.cos(angle), np.sin(angle)])
        if robot.state is DriverState.HOLD:
            robot.disable()
            robot.advance(0.1)
            robot.enable()
        robot.send_action(velocity, STEP)
        for _ in range(round(STEP / 0.002)):
            robot.advance(0.002)
            top = max(top, float(np.linalg.norm(robot.true_velocity)))
    return top


@pytest.mark.parametrize("seed", [3, 6])
def test_an_arm_that_is_late_no_more_does_not_leap(seed):
    robot, rng = EmulatedRobot(), np.random.default_rng(seed)
    assert robot.drive_to(np.array(robot.setup.home) - (0.0, 0.1))
    robot.enable()
    reasons = set()
    for _ in range(15):
        wander(robot, rng, rng.uniform(0.2, 1.0))
        robot.switch("servo_lag")
        wander(robot, rng, rng.uniform(0.1, 1.5))
        reasons.add(robot.fault)
        robot.switch("servo_lag", False)
        assert wander(robot, rng, 0.5) < 1.02 * LIMIT
    assert reasons == {Fault.NONE, Fault.DEVIATION}


def test_an_arm_in_order_is_never_sent_slower():
    robot, rng = EmulatedRobot(), np.random.default_rng(0)
    assert robot.drive_to(np.array(robot.setup.home) - (0.0, 0.1))
    robot.enable()
    slowest = 1.0
    for _ in range(200):
        wander(robot, rng, STEP)
        slowest = min(slowest, robot.get_observation().speed_scaling)
    assert slowest == 1.0
    assert robot.state is DriverState.RUNNING


def test_an_arm_that_stays_a_little_late_is_sent_slower_then_held():
    robot = moving_robot()
    robot.switch("servo_lag")
    slowest = 1.0
    while robot.state is DriverState.RUNNING:
        drive(robot, seconds=STEP)
        slowest = min(slowest, robot.get_observation().speed_scaling)
        assert robot.now < 60.0
    assert slowest < 0.8
    assert robot.fault is Fault.DEVIATION
