"""The driver of a robot against the emulated controller, in emulated time."""

import math

import numpy as np
import pytest
from driven import STEP, UP, drive, moving_robot

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot
from marl_airhockey.hardware.robot import (
    FILTERS,
    PRESETS,
    DriverState,
    Fault,
    MotionLimits,
    Pendant,
    RobotConfig,
    Smoothing,
)
from marl_airhockey.hardware.ur_emulator.arm import JOINT_ACCELERATION
from marl_airhockey.hardware.ur_emulator.plant import PlantReading
from marl_airhockey.hardware.ur_emulator.safety import Safety
from marl_airhockey.sim.core.geometry import half_planes

LATENCY = {
    **dict.fromkeys(["protective_stop", "emergency_stop", "power_off"], 0.004),
    **dict.fromkeys(["silent_robot", "delayed_packets", "dropped_connection"], 0.075),
    **dict.fromkeys(["loss_of_real_time", "puck_under_paddle"], 0.075),
}
"""Longest time until braking begins after a fault of the robot, s"""


@pytest.fixture
def robot():
    return moving_robot()


def until_braking(robot, seconds=0.3):
    """Return the time until what the arm is sent, or the arm itself, is slower."""
    began = robot.now
    due = began
    while robot.now < began + seconds:
        if robot.now >= due:
            robot.send_action(UP, STEP)
            due += STEP
        robot.advance(0.002)
        sent = robot.get_observation()
        speeds = (
            np.hypot(sent.sent_vx, sent.sent_vy),
            np.linalg.norm(robot.true_velocity),
        )
        if min(speeds) < 0.97 * 0.5:
            return robot.now - began
    return math.inf


def wild_drive(robot, minutes, seed):
    """Drive with random, wild and NaN commands, and gaps; yield every control step."""
    rng = np.random.default_rng(seed)
    for step in range(round(minutes * 60 / STEP)):
        kind = rng.integers(8)
        velocity = rng.uniform(-9.0, 9.0, 2) * 10.0 ** rng.uniform(-2, 3)
        if kind == 0:
            velocity = rng.choice([np.nan, np.inf, -np.inf, 0.7], 2)
        if kind != 1 or step % 5:
            robot.send_action(velocity, rng.choice([0.0, STEP, 1.0]))
        robot.advance(STEP)
        yield step


@pytest.mark.slow
def test_ten_minutes_of_wild_commands_trip_nothing_and_keep_the_reach():
    robot = EmulatedRobot()
    robot.enable()
    normals, offsets = half_planes(robot.setup.seat.reach)
    room, speed, deviation, force = [], [], [], []
    for step in wild_drive(robot, 10.0, 1):
        now = robot.get_observation()
        room.append((normals @ robot.true_position[:2] + offsets).min())
        speed.append(np.linalg.norm(robot.true_velocity))
        deviation.append(np.hypot(now.x - now.sent_x, now.y - now.sent_y))
        if step > 40:
            force.append(now.force)
    assert robot.controller.arm.safety is Safety.NORMAL
    assert robot.state in (DriverState.RUNNING, DriverState.HOLD)
    assert min(room) > 0.0
    assert max(speed) < 1.02 * robot.config.limits.speed
    assert max(deviation) < 0.06
    assert min(force) > 4.0
    assert max(force) < 6.0


def test_wild_commands_keep_acceleration_and_jerk_of_what_is_sent():
    robot = EmulatedRobot()
    robot.enable()
    sent = []
    for _ in wild_drive(robot, 0.2, 2):
        now = robot.get_observation()
        sent.append((now.sent_vx, now.sent_vy))
    change = np.linalg.norm(np.diff(sent, axis=0), axis=1) / STEP
    assert change.max() <= 1.2 * robot.config.limits.acceleration


@pytest.mark.parametrize("fault", LATENCY)
def test_a_fault_of_the_robot_is_braked(robot, fault):
    robot.switch(fault)
    assert until_braking(robot) <= LATENCY[fault]
    before, since = robot.controller.arm.speeds, robot.now
    while np.linalg.norm(robot.true_velocity) > 0.01:
        # A driver that waits for its controller lets more time pass.
        robot.advance(0.002)
        now = robot.controller.arm.speeds
        slowing = np.max(np.abs(before) - np.abs(now)) / (robot.now - since)
        assert slowing <= JOINT_ACCELERATION + 1e-6
        before, since = now, robot.now
    robot.advance(0.1)
    assert robot.state in (DriverState.FAULT, DriverState.HOLD)


def test_commands_that_stop_are_braked_within_160_ms(robot):
    last = robot.now - STEP  # That is when `drive` has sent the last one.
    while robot.state is DriverState.RUNNING:
        robot.advance(0.002)
    assert robot.fault is Fault.COMMAND_STALE
    assert robot.now - last <= 0.160
    robot.send_action(np.zeros(2), STEP)
    robot.advance(0.02)
    assert robot.state is DriverState.RUNNING


def test_a_command_that_is_no_number_is_braked_and_counted(robot):
    robot.send_action(np.full(2, np.nan), STEP)
    robot.advance(STEP)
    now = robot.get_observation()
    assert now.refused == 1
    assert now.sent_vy < 0.45
    assert robot.state is DriverState.RUNNING


def test_a_killed_driver_leaves_the_arm_at_rest_and_its_program_ends(
    robot,
):
    robot.driver_runs = False
    robot.advance(0.2)
    assert np.linalg.norm(robot.true_velocity) < 0.01
    assert not robot.controller.script.running


def test_a_protective_stop_is_released_on_request_after_five_seconds(robot):
    robot.switch("protective_stop")
    robot.advance(0.1)
    assert (robot.state, robot.fault) == (DriverState.FAULT, Fault.PROTECTIVE_STOP)
    robot.recover()
    robot.advance(0.1)
    assert robot.state is DriverState.FAULT
    robot.advance(6.0)
    assert robot.state is DriverState.FAULT  # Never without another request.
    robot.recover()
    robot.advance(0.3)
    assert robot.state is DriverState.READY
    assert robot.drive_to(robot.setup.home)


def test_a_word_given_before_a_stop_is_not_for_it(robot):
    robot.recover()
    robot.enable()
    drive(robot, UP, 0.2)
    assert robot.state is DriverState.RUNNING
    robot.controller.script.kill()
    robot.advance(1.0)
    assert (robot.state, robot.fault) == (DriverState.FAULT, Fault.PROGRAM_LOST)
    assert not robot.controller.script.running
    robot.recover()
    robot.advance(1.0)
    assert robot.state is DriverState.READY


def test_an_emergency_stop_is_never_released(robot):
    robot.switch("emergency_stop")
    robot.advance(6.0)
    robot.switch("emergency_stop", False)
    robot.advance(0.1)
    for _ in range(3):
        robot.recover()
        robot.advance(1.0)
    assert (robot.state, robot.fault) == (DriverState.FAULT, Fault.EMERGENCY_STOP)
    assert np.linalg.norm(robot.true_velocity) < 1e-3


def test_a_lifted_paddle_is_held_until_the_caller_lets_go(robot):
    robot.switch("puck_under_paddle")
    drive(robot, UP, 0.3)
    assert (robot.state, robot.fault) == (DriverState.HOLD, Fault.PADDLE_LIFTED)
    robot.switch("puck_under_paddle", False)
    drive(robot, UP, 0.5)
    assert robot.state is DriverState.HOLD
    robot.disable()
    robot.advance(0.05)
    assert robot.state is DriverState.READY


def test_an_arm_that_does_not_follow_is_held(robot):
    robot.switch("servo_lag")
    drive(robot, UP, 0.5)
    assert (robot.state, robot.fault) == (DriverState.HOLD, Fault.DEVIATION)


def test_an_arm_away_from_the_table_is_refused_and_not_moved():
    robot = EmulatedRobot(away=0.6)
    assert (robot.state, robot.fault) == (DriverState.FAULT, Fault.NOT_AT_TABLE)
    before = robot.true_position
    robot.enable()
    drive(robot)
    robot.recover()
    robot.advance(1.0)
    np.testing.assert_allclose(robot.true_position, before, atol=1e-6)
    assert robot.state is DriverState.FAULT


def test_changes_of_the_state_are_kept_with_their_reasons(robot):
    robot.advance(0.2)
    drive(robot, UP, 0.1)
    robot.switch("emergency_stop")
    robot.advance(0.1)
    changes = [(t.state.name, t.fault.label) for t in robot.transitions]
    assert changes[-4:] == [
        ("RUNNING", "none"),
        ("HOLD", "command stale"),
        ("RUNNING", "none"),
        ("FAULT", "emergency stop"),
    ]
    times = [t.time for t in robot.transitions]
    assert times == sorted(times)


def test_the_force_sensor_is_zeroed_in_free_air_alone():
    robot = EmulatedRobot()
    robot.enable()
    drive(robot, np.zeros(2), 1.5)
    assert robot.get_observation().force == pytest.approx(5.0, abs=0.3)
    robot.start_driver()
    robot.enable()
    drive(robot, np.zeros(2), 1.0)
    assert robot.get_observation().force == pytest.approx(5.0, abs=0.3)


def test_limits_near_the_pendants_are_refused():
    setup = EmulatedRobot().setup
    with pytest.raises(ValueError, match=r"above 70% of the pendant's 1\.5 m/s"):
        RobotConfig(
            *("", setup.mounting, setup.seat.reach, MotionLimits(speed=1.2)),
            pendant=Pendant(speed=1.5),
        )


def test_the_authors_constants_trip_the_arm_where_ours_do_not():
    stops = {}
    for name in ("ur5e", "authors"):
        robot = EmulatedRobot(PRESETS[name])
        robot.enable()
        for k in range(20):
            drive(robot, np.array([0.0, 5.0 * (-1) ** k]), 0.4)
        stops[name] = robot.controller.arm.safety
    assert stops == {"ur5e": Safety.NORMAL, "authors": Safety.PROTECTIVE_STOP}


def test_a_plant_decides_what_is_measured_and_felt():
    seen = []

    def plant(pose, velocity):
        seen.append(pose)
        return PlantReading(pose + 0.001, np.array([0, 0, 3.0, 0, 0, 0]))

    arm = EmulatedRobot().setup.make_arm(plant)
    arm.step()
    assert len(seen) >= 2
    assert arm.measured_force[2] == 3.0
    np.testing.assert_allclose(arm.reading.pose, seen[-1] + 0.001)


HUGE = [(1e308, 0.0), (-1e308, 1e308), (1.7e308, 1.7e308), (5e-324, -1e308)]


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("seconds", [STEP, 0.0, 1e-300, 1e300, math.nan, -1.0])
def test_no_command_makes_a_filter_nan(name, seconds):
    robot = EmulatedRobot(smoothing=Smoothing(name))
    robot.enable()
    for command in HUGE * 3:
        robot.send_action(np.array(command), seconds)
        robot.advance(STEP)
    drive(robot, UP, 0.6)
    now = robot.get_observation()
    assert robot.state is DriverState.RUNNING
    assert now.sent_vy == pytest.approx(0.5, abs=0.05)
