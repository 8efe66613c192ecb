"""Axes of the arm in the states that promise rest, in emulated time."""

import numpy as np
import pytest
from driven import STEP, UP, drive, moving_robot

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.robot import DriverState, Fault
from marl_airhockey.hardware.robot.kinematics import matrix_of, vector_of
from marl_airhockey.hardware.robot.supervisor import OFF_TABLE


@pytest.fixture
def robot():
    return moving_robot()


def remove_table(robot):
    """Take the table away from under the paddle."""
    robot.controller.arm.plant.raised = -1.0


def drift_sensor(robot, newtons):
    """Let the force sensor report a force along the table's normal that is not there.

    Above 0 the table seems to press on the paddle.
    """
    normal = np.array(robot.setup.mounting.rotation)[:, 2]
    robot.controller.arm.force_drift[:3] = newtons * normal


def rested_height(robot, seconds=2.0):
    """Return the largest change of the height after 0.6 s in which it may brake."""
    robot.advance(0.6)
    heights = []
    for _ in range(round(seconds / 0.02)):
        robot.advance(0.02)
        heights.append(robot.true_position)
    return np.ptp(heights, axis=0).max()


def stop_commands(robot):
    """Send nothing more: HOLD."""


def disable(robot):
    robot.disable()


def lift(robot):
    robot.switch("puck_under_paddle")
    drive(robot, UP, 0.2)


def protective_stop(robot):
    robot.switch("protective_stop")


def silent(robot):
    robot.switch("silent_robot")


def dropped(robot):
    robot.switch("dropped_connection")


@pytest.mark.parametrize(
    ("leave", "state"),
    [
        (stop_commands, DriverState.HOLD),
        (disable, DriverState.READY),
        (lift, DriverState.HOLD),
        (protective_stop, DriverState.FAULT),
        (silent, DriverState.FAULT),
        (dropped, DriverState.FAULT),
    ],
)
@pytest.mark.parametrize("upset", ["table", "no table", "drift -6 N", "drift +6 N"])
def test_every_axis_rests_outside_running(robot, leave, state, upset):
    leave(robot)
    robot.advance(0.6)
    assert robot.state is state
    if upset == "no table":
        remove_table(robot)
    elif upset != "table":
        drift_sensor(robot, float(upset.split()[1]))
    assert rested_height(robot) < 1e-3
    assert robot.controller.arm.force is None


@pytest.mark.parametrize(
    "upset", [remove_table, lambda robot: drift_sensor(robot, 9.0)]
)
def test_a_paddle_that_leaves_the_plane_is_held_within_two_centimetres(robot, upset):
    upset(robot)
    farthest = 0.0
    for _ in range(80):
        drive(robot, UP, STEP)
        farthest = max(farthest, abs(robot.true_position[2]))
    assert robot.state is DriverState.HOLD
    assert robot.fault in (Fault.PADDLE_BELOW_TABLE, Fault.PADDLE_LIFTED)
    assert farthest < OFF_TABLE
    assert rested_height(robot) < 1e-3


def test_a_paddle_far_from_the_plane_is_a_fault_and_halts(robot):
    # A compliance of 1.5 m/s is past the limit before the paddle has braked.
    robot.arm._servo = robot.arm._servo.__class__(compliance=1.5)
    robot.disable()
    robot.advance(0.5)
    robot.enable()
    drive(robot, -UP, 0.5)
    remove_table(robot)
    drift_sensor(robot, -145.0)
    drive(robot, -UP, 0.3)
    assert (robot.state, robot.fault) == (DriverState.FAULT, Fault.PADDLE_OFF_TABLE)
    assert rested_height(robot) < 1e-3
    robot.recover()
    robot.advance(0.5)
    assert robot.state is DriverState.FAULT  # It is below the table still.


def test_no_command_leads_out_of_a_paddle_below_the_table(robot):
    remove_table(robot)
    drive(robot, UP, 1.0)
    assert robot.fault is Fault.PADDLE_BELOW_TABLE
    robot.disable()
    robot.advance(0.1)
    height = robot.true_position[2]
    robot.enable()
    drive(robot, UP, 1.0)
    assert (robot.state, robot.fault) == (DriverState.HOLD, Fault.PADDLE_BELOW_TABLE)
    assert abs(robot.true_position[2] - height) < 1e-3


def test_a_driver_that_starts_moves_nothing():
    robot = EmulatedRobot()
    before = robot.true_position
    assert before[2] == pytest.approx(0.02, abs=1e-3)
    robot.advance(1.0)
    np.testing.assert_allclose(robot.true_position, before, atol=1e-5)
    robot.enable()
    speeds = []
    for _ in range(40):
        drive(robot, np.zeros(2), STEP)
        speeds.append(np.abs(robot.controller.arm.twist[:3]).max())
    assert max(speeds) < 1.1 * robot.config.servo.compliance
    assert abs(robot.true_position[2]) < 1e-3


def turn(config, degrees):
    """Return a configuration whose tool on the table is turned about its axis."""
    mounting = config.mounting
    about = matrix_of(np.array([0.0, 0.0, np.radians(degrees)]))
    tool = vector_of(np.ascontiguousarray(matrix_of(np.array(mounting.tool)) @ about))
    return mounting.of(
        *(np.array(x) for x in (mounting.origin, mounting.rotation)), tool
    )


@pytest.mark.parametrize(
    ("degrees", "fault"), [(1.0, Fault.NONE), (20.0, Fault.NOT_AT_TABLE)]
)
def test_an_arm_whose_tool_is_turned_is_not_snapped_back(degrees, fault):
    robot = EmulatedRobot()
    robot.config = robot.config.__class__(
        "", turn(robot.config, degrees), robot.config.reach
    )
    robot.start_driver()
    assert robot.fault is fault
    assert robot.get_observation().misalignment == pytest.approx(
        np.radians(degrees), abs=1e-3
    )


def test_the_force_of_a_running_robot_is_on_the_table_alone(robot):
    drive(robot, np.zeros(2), 0.5)
    assert robot.get_observation().force == pytest.approx(5.0, abs=0.3)
    robot.disable()
    robot.advance(1.0)
    robot.enable()
    drive(robot, np.zeros(2), 1.2)
    assert robot.get_observation().force == pytest.approx(5.0, abs=0.3)


def test_the_reported_velocity_is_that_of_the_arm_in_force_mode(robot):
    """Also while its servo target is far from where the force holds it."""
    arm = robot.controller.arm
    off, before = [], robot.true_position
    robot.switch("puck_under_paddle")
    for k in range(200):
        if k % 25 == 0:
            robot.send_action(UP * (1.0 if k < 60 else -1.0), STEP)
        since = robot.now
        robot.advance(0.002)
        moved = (robot.true_position - before) / (robot.now - since)
        told = robot.setup.mounting.rotate_to_table(np.array(arm.twist[:3]))
        off.append(np.abs(moved - told).max())
        before = robot.true_position
    # While the driver waits for the controller, the mean of some periods counts.
    assert np.quantile(off, 0.97) < 2e-3


@pytest.mark.parametrize("stop", ["protective_stop", "emergency_stop", "power_off"])
def test_a_stop_in_force_mode_does_not_jump(robot, stop):
    remove_table(robot)
    robot.controller.arm.target = robot.controller.arm.target + 0.05
    before = robot.true_position
    robot.switch(stop)
    robot.advance(0.5)
    moved = robot.true_position - before
    # From 0.5 m/s, at 20 rad/s2 of the fastest joint.
    assert np.linalg.norm(moved) < 0.02
    assert abs(moved[2]) < 2e-3
