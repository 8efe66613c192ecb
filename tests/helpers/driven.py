"""Robots in emulated time that are driven."""

import numpy as np

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot

STEP = 0.05
UP = np.array([0.0, 0.5])


def drive(robot, velocity=UP, seconds=0.4):
    """Command a velocity for some seconds."""
    for _ in range(round(seconds / STEP)):
        robot.send_action(velocity, STEP)
        robot.advance(STEP)


def moving_robot():
    """Return a robot that presses its paddle on the table and moves at 0.5 m/s."""
    made = EmulatedRobot()
    assert made.drive_to(np.array(made.setup.home) - (0.0, 0.25))
    drive(made, np.zeros(2), 1.2)
    drive(made)
    assert abs(np.linalg.norm(made.true_velocity) - 0.5) < 0.02
    return made
