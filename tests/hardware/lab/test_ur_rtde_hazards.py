"""Defects of ur_rtde 1.6.5 and what a UR controller does, each handled by the driver.

The real client talks to the emulator in a process of its own.
"""

import json
import socket
import threading
import time

import numpy as np
import pytest
from emulators import ADDRESS, emulator, status, switch, until

from marl_airhockey.hardware.lab.setup import LabSetup
from marl_airhockey.hardware.robot import (
    ArmFault,
    DriverState,
    Fault,
    Robot,
    RobotConfig,
    RobotError,
)
from marl_airhockey.hardware.robot.ur5e import Ur5e
from marl_airhockey.hardware.ur_emulator.ports import SECONDARY

pytest.importorskip("rtde_control")
rtde_io = pytest.importorskip("rtde_io")
SETUP = LabSetup()
CONFIG = RobotConfig(ADDRESS, SETUP.mounting, SETUP.seat.reach)
DT = 0.008
SERVO, FORCE, STOP_LINE, STOP_JOINTS = "24", "6", "33", "34"
"""Numbers of commands"""
UP = np.array([0.0, 0.3])


@pytest.fixture
def running():
    """An emulator that runs at `ADDRESS`."""
    with emulator():
        yield


@pytest.fixture
def arm(running):
    """The arm of a driver, without its process."""
    made = Ur5e(CONFIG)
    yield made
    made.close()


@pytest.fixture
def robot(running):
    """A robot at home, enabled."""
    with Robot(CONFIG) as connected:
        connected.go_to(SETUP.home)
        yield connected


def servo(arm, seconds, position=SETUP.home, height=0.02, speed=0.0):
    """Send poses that move along y at a speed, m/s."""
    for k in range(round(seconds / DT)):
        place = position + np.array([0.0, speed * k * DT])
        if not arm.follow(SETUP.mounting.pose(place, height), DT):
            return False
        time.sleep(DT)
    return True


def drive(robot, seconds, velocity=UP):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        robot.send_action(velocity, 0.05)
        time.sleep(0.05)


def test_limits_hold_although_those_of_servo_l_do_nothing(robot):
    """1: it reads a speed and an acceleration and never uses them."""
    drive(robot, 0.5, np.array([0.0, 50.0]))
    now = robot.get_observation()
    assert np.hypot(now.sent_vx, now.sent_vy) <= CONFIG.limits.speed + 1e-6
    assert np.hypot(now.vx, now.vy) <= 1.05 * CONFIG.limits.speed


def test_an_arm_that_hears_nothing_stops_and_its_program_ends(arm):
    """2: speedL never times out, servoL holds its last pose: there is a watchdog."""
    assert servo(arm, 0.3, speed=0.2)
    assert until(lambda: status()["program"] == "stopped", 1.0)
    # The arm brakes for some 20 ms after its program has ended.
    assert until(lambda: status()["speed"] < 0.01, 0.5)
    assert arm.read().fault is ArmFault.PROGRAM_LOST


@pytest.mark.slow
def test_a_command_after_the_force_mode_does_not_replace_it(arm):
    """3: of two commands in one period of the controller the first is lost."""

    def pressed():
        assert servo(arm, 0.05)
        return status()["commands"].get(FORCE, 0)

    for _ in range(10):
        before = pressed()
        arm.press(SETUP.mounting.frame(), 5.0)
        assert until(lambda count=before: pressed() > count, 1.0)


@pytest.mark.slow
def test_the_last_command_is_not_run_again_after_a_restart(arm):
    """4: registers keep their values, so that a new program runs the old command."""
    assert servo(arm, 0.3, speed=0.2)
    switch("protective_stop", "--address", ADDRESS)
    assert until(lambda: arm.read().fault is ArmFault.PROTECTIVE_STOP)
    assert "5s" in arm.unlock()
    time.sleep(5.1)
    counted = status()["commands"][SERVO]
    pose = arm.read().pose
    assert arm.unlock() == ""
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        assert np.abs(arm.read().pose - pose).max() < 1e-4
    assert status()["commands"][SERVO] == counted


@pytest.mark.slow
def test_a_silent_robot_is_a_fault_although_the_client_says_nothing(robot):
    """5: isConnected() and servoL() are True for seconds after it went silent."""
    drive(robot, 0.3)
    switch("silent_robot", "--address", ADDRESS)
    assert until(lambda: robot.state is DriverState.FAULT, 1.0)
    assert robot.fault is Fault.ROBOT_SILENT
    switch("silent_robot", "--off", "--address", ADDRESS)


@pytest.mark.slow
def test_a_lost_connection_gets_a_new_process(robot):
    """6 and 12: the client reconnects for ever, and returns its last values."""
    drive(robot, 0.3)
    first, pid = robot.get_observation(), robot.pid
    switch("dropped_connection", "--address", ADDRESS)
    assert until(lambda: robot.state is DriverState.FAULT, 1.0)
    assert robot.fault is Fault.CONNECTION_LOST
    assert until(lambda: status()["speed"] < 0.01, 1.0)
    later = robot.get_observation()
    assert later.robot_time > first.robot_time
    time.sleep(0.2)
    assert robot.get_observation().robot_time == later.robot_time
    switch("dropped_connection", "--off", "--address", ADDRESS)
    robot.recover()
    assert robot.pid != pid
    robot.go_to(SETUP.home)


@pytest.mark.slow
def test_the_caller_runs_while_the_driver_connects(running):
    """7: constructors hold Python's lock, so the driver has a process of its own."""
    gaps, ended = [], threading.Event()

    def tick():
        last = time.monotonic()
        while not ended.wait(0.01):
            gaps.append(time.monotonic() - last)
            last = time.monotonic()

    ticking = threading.Thread(target=tick)
    ticking.start()
    with Robot(CONFIG) as robot:
        assert robot.is_connected
    ended.set()
    ticking.join()
    assert max(gaps) < 0.5 * sum(gaps)


def test_a_pose_that_is_no_number_is_not_sent(arm):
    """8: it would end the program, and the client would not say so."""
    pose = SETUP.mounting.pose(SETUP.home, 0.02)
    pose[1] = np.nan
    assert not arm.follow(pose, DT)
    assert servo(arm, 0.1)


def test_a_pose_out_of_reach_is_noticed_at_the_next_one(arm):
    """8: the call that ends the program returns True."""
    far = SETUP.mounting.pose(SETUP.home + np.array([3.0, 0.0]), 0.02)
    assert arm.follow(far, DT)
    time.sleep(0.05)
    assert not servo(arm, 0.05)
    assert arm.read().fault is ArmFault.PROGRAM_LOST


def test_a_halt_uses_neither_stop_l_nor_stop_j(arm):
    """9: the script mixes the two up."""
    assert servo(arm, 0.2, speed=0.2)
    arm.halt()
    assert status()["speed"] < 0.01
    assert not {STOP_LINE, STOP_JOINTS} & status()["commands"].keys()


@pytest.mark.slow
def test_the_reason_of_a_stop_is_named_although_it_comes_late(robot):
    """10: servoL fails before the other stream says why."""
    drive(robot, 0.3)
    switch("protective_stop", "--address", ADDRESS)
    assert until(lambda: robot.state is DriverState.FAULT, 1.0)
    drive(robot, 0.1)
    assert robot.fault is Fault.PROTECTIVE_STOP
    reasons = {change.fault for change in robot.transitions[-2:]}
    assert Fault.PROTECTIVE_STOP in reasons


@pytest.mark.slow
def test_a_stop_is_not_released_before_five_seconds(robot):
    """11: nor ever without a person's word."""
    switch("protective_stop", "--address", ADDRESS)
    assert until(lambda: robot.fault is Fault.PROTECTIVE_STOP)
    with pytest.raises(RobotError, match="at least 5 s"):
        robot.recover()
    time.sleep(2.5)
    assert robot.state is DriverState.FAULT
    robot.recover()
    assert robot.state is DriverState.READY


@pytest.mark.parametrize(
    ("words", "fault", "reason"),
    [
        ((), "local_control", "switch it to remote control"),
        ((), "power_off", "switch the arm on"),
        (("--polyscope", "3.15.4"), None, "PolyScope .*3.15.4.* is not supported"),
    ],
)
def test_a_controller_that_cannot_be_used_is_refused(words, fault, reason):
    with emulator(*words):
        if fault:
            switch(fault, "--address", ADDRESS)
        with pytest.raises(RobotError, match=reason):
            Robot(CONFIG).connect()
        assert status()["program"] == "stopped"


@pytest.mark.slow
def test_an_arm_at_another_table_is_refused_and_does_not_move(running):
    before = status()["pose"]
    far = ((-0.8, 0.1), (-0.6, 0.1), (-0.6, 0.3), (-0.8, 0.3))
    with pytest.raises(RobotError, match=r"z \+0\.020 m of the table, turned by 0 deg"):
        Robot(RobotConfig(ADDRESS, SETUP.mounting, far)).connect()
    assert status()["pose"] == before


def test_a_status_is_plain_json(running):
    assert json.loads(json.dumps(status()))["safety"] == "NORMAL"


def test_a_second_robot_is_refused_and_the_first_continues(robot):
    drive(robot, 0.2)
    # At rest: the start of another process may silence a busy machine.
    robot.disable()
    assert until(lambda: robot.state is DriverState.READY)
    uploads = status()["uploads"]
    with pytest.raises(RobotError, match="does another client control it"):
        Robot(CONFIG).connect()
    assert robot.state is DriverState.READY
    robot.enable()
    drive(robot, 0.3)
    assert robot.state is DriverState.RUNNING
    assert robot.get_observation().vy > 0.2
    assert [change.fault for change in robot.transitions[-1:]] == [Fault.NONE]
    assert status()["uploads"] == uploads


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["protective_stop", "dropped_connection"])
def test_a_client_sends_no_program_after_a_fault(robot, fault):
    drive(robot, 0.3)
    switch(fault, "--address", ADDRESS)
    assert until(lambda: robot.state is DriverState.FAULT, 1.0)
    uploads = status()["uploads"]
    switch(fault, "--off", "--address", ADDRESS)
    time.sleep(3.0)
    assert status()["uploads"] == uploads
    assert status()["program"] == "stopped"
    assert robot.state is DriverState.FAULT
    robot.recover()
    robot.go_to(SETUP.home)


def test_a_program_of_another_client_is_a_fault(robot):
    drive(robot, 0.3)
    with socket.create_connection((ADDRESS, SECONDARY), 3.0) as link:
        link.sendall(b"def other():\n  sleep(60)\nend\n")
        assert until(lambda: robot.state is DriverState.FAULT, 1.0)
    assert robot.fault is Fault.PROGRAM_LOST
    assert until(lambda: status()["speed"] < 0.01, 1.0)
    robot.recover()
    robot.go_to(SETUP.home)


@pytest.mark.slow
def test_the_speed_slider_of_another_client_slows_the_robot(robot):
    slider = rtde_io.RTDEIOInterface(ADDRESS)
    assert slider.setSpeedSlider(0.2)
    drive(robot, 0.6)
    assert robot.state is DriverState.RUNNING
    speeds = []
    for _ in range(10):
        drive(robot, 0.05)
        speeds.append(robot.get_observation().vy)
    assert 0.10 < max(speeds) < 0.16
    assert slider.setSpeedSlider(1.0)
    for _ in range(10):
        drive(robot, 0.05, -UP)
        speeds.append(abs(robot.get_observation().vy))
    slider.disconnect()
    assert max(speeds) < 1.03 * 0.3


@pytest.mark.slow
def test_a_late_state_delays_the_start_and_moves_nothing():
    with emulator():
        before = status()["pose"]
        switch("late_state", "--address", ADDRESS)
        with Robot(CONFIG) as robot:
            assert robot.state is DriverState.READY
            assert status()["pose"] == before


@pytest.mark.slow
def test_a_client_whose_recipes_are_forgotten_is_refused():
    with emulator():
        before = status()["pose"]
        switch("forgotten_recipes", "--address", ADDRESS)
        with pytest.raises(RobotError, match="control script did not start"):
            Robot(CONFIG).connect()
        assert status()["pose"] == before
