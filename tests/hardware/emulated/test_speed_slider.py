"""The speed slider: no history of it makes the paddle faster than its limit."""

import numpy as np
import pytest

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.robot import DriverState, Fault, MotionLimits, Preset

STEP = 0.05


def shuttle(robot, seconds, slider, tight=0.002):
    """Drive up and down while the slider moves; return the largest speed, m/s.

    Args:
        robot: Robot.
        seconds: Time of the drive, s.
        slider: Function of the time, s, that returns the slider's fraction.
        tight: Time between two samples of the speed, s.
    """
    top, began, up = 0.0, robot.now, 1.0
    home = np.asarray(robot.setup.home)
    while robot.now - began < seconds:
        y = robot.true_position[1] - home[1]
        up = -np.sign(y) if abs(y) > 0.25 else up
        robot.send_action(np.array([0.0, up]), STEP)
        for _ in range(round(STEP / tight)):
            robot.controller.arm.speed_fraction = slider(robot.now - began)
            robot.advance(tight)
            top = max(top, float(np.linalg.norm(robot.true_velocity)))
    return top


def robot_of(limit):
    robot = EmulatedRobot(Preset(MotionLimits(speed=limit)))
    assert robot.drive_to(robot.setup.home)
    return robot


@pytest.mark.parametrize("limit", [0.1, 0.3, 0.7])
def test_a_slider_that_returns_makes_no_leap(limit):
    robot = robot_of(limit)
    top = shuttle(robot, 4.0, lambda t: 0.1 if 0.7 < t < 2.7 else 1.0)
    assert top <= 1.02 * limit
    assert robot.state is DriverState.RUNNING


@pytest.mark.parametrize("limit", [0.1, 0.7])
@pytest.mark.parametrize("seed", range(4))
def test_no_history_of_the_slider_exceeds_the_limit(limit, seed):
    robot, rng = robot_of(limit), np.random.default_rng(seed)
    times = np.cumsum(rng.exponential(0.3, 60))
    values = rng.choice([0.0, 0.02, 0.1, 0.3, 0.6, 1.0], 61)
    slider = lambda t: values[np.searchsorted(times, t)]  # noqa: E731
    top = 0.0
    for _ in range(5):
        robot.disable()
        robot.advance(0.1)
        robot.enable()
        top = max(top, shuttle(robot, 2.0, slider))
    assert top <= 1.02 * limit


def test_a_slow_slider_slows_the_paddle_and_the_episode_continues():
    robot = robot_of(0.7)
    top = shuttle(robot, 1.0, lambda t: 0.3)
    top = shuttle(robot, 2.0, lambda t: 0.3)
    assert 0.18 < top < 0.22
    assert robot.state is DriverState.RUNNING
    assert robot.get_observation().speed_scaling == pytest.approx(0.3)


def test_an_arm_that_falls_behind_is_held_where_it_is():
    robot = robot_of(0.7)
    shuttle(robot, 0.6, lambda t: 1.0)
    robot.switch("servo_lag")
    shuttle(robot, 0.8, lambda t: 1.0)
    assert (robot.state, robot.fault) == (DriverState.HOLD, Fault.DEVIATION)
    robot.advance(2.0)
    robot.switch("servo_lag", False)
    before = robot.true_position
    robot.advance(1.0)
    assert np.linalg.norm(robot.true_position - before) < 2e-3
