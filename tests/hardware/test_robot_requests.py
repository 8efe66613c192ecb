"""What a caller requests of a robot's driver, without an arm."""

import threading

import numpy as np
import pytest

from marl_airhockey.hardware.robot import Robot, RobotConfig
from marl_airhockey.hardware.robot.mailbox import Mailbox
from marl_airhockey.hardware.robot.nominal import nominal_mounting
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

TABLE = TABLES["full_size"]
CONFIG = RobotConfig("", nominal_mounting(TABLE), make_seat("robot", TABLE, 0).reach)


@pytest.fixture
def robot():
    """A robot whose driver only has a mailbox."""
    made = Robot(CONFIG)
    made._box = Mailbox(Mailbox.allocate())
    return made


def test_disable_outlasts_the_commands_of_other_threads(robot):
    robot.enable()
    ended, started = threading.Event(), threading.Barrier(4)

    def command():
        started.wait()
        while not ended.is_set():
            robot.send_action(np.array([0.0, 0.3]), 0.05)

    threads = [threading.Thread(target=command) for _ in range(3)]
    for thread in threads:
        thread.start()
    started.wait()
    try:
        for _ in range(200):
            robot.enable()
            robot.disable()
            for _ in range(20):
                assert robot._box.request.enabled == 0.0
    finally:
        ended.set()
        for thread in threads:
            thread.join()


@pytest.mark.parametrize(
    ("velocity", "seconds"),
    [
        ([np.nan, 0.0], 0.05),
        ([np.inf, 0.0], 0.05),
        ([1.7e308, 1.7e308], 0.05),
        ([0.1, 0.0], np.nan),
    ],
)
def test_a_command_that_is_no_number_counts_as_zero(robot, velocity, seconds):
    robot.enable()
    assert robot.send_action(velocity, seconds).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("velocity", [0.3, [0.3], [0.1, 0.2, 0.3], [[0.1, 0.2]]])
def test_a_command_of_another_shape_is_a_value_error(robot, velocity):
    robot.enable()
    with pytest.raises(ValueError, match=r"expected \(2,\), m/s"):
        robot.send_action(velocity, 0.05)
