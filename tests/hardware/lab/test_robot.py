"""The real client of ur_rtde against the lab's controller: nothing trips, all stops."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marl_airhockey.hardware.robot import (
    DriverState,
    Fault,
    Robot,
    RobotConfig,
    RobotError,
)
from marl_airhockey.sim.core.geometry import half_planes

UP = np.array([0.0, 0.5])


def config_of(lab):
    setup = lab.setup
    return RobotConfig(lab.host, setup.mounting, setup.seat.reach)


@pytest.fixture
def robot(lab):
    """A robot whose paddle is at home, enabled."""
    with Robot(config_of(lab)) as connected:
        connected.go_to(lab.setup.home)
        yield connected


def wait_for(condition, seconds=3.0):
    until = time.monotonic() + seconds
    while not condition() and time.monotonic() < until:
        time.sleep(0.002)
    return condition()


def runs(pid):
    """False for a process that is gone, or that nobody has asked after since."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False
    return "State:\tZ" not in status


def drive(robot, velocity=UP, times=6):
    """Ask for a velocity for some control steps."""
    for _ in range(times):
        robot.send_action(velocity, 0.05)
        time.sleep(0.05)


def paddle_speed(lab):
    return np.linalg.norm(lab.ask({"do": "truth"})["paddle"][3:5])


@pytest.mark.slow
def test_wild_commands_trip_nothing(lab, robot):
    rng, places = np.random.default_rng(0), []
    for k in range(60):
        velocity = rng.uniform(-9.0, 9.0, 2)
        robot.send_action(np.full(2, np.nan) if k % 7 == 3 else velocity, 0.05)
        until = time.monotonic() + 0.05
        while time.monotonic() < until:
            places.append(robot.get_observation()[4:6])
            time.sleep(0.005)
    assert robot.state is DriverState.RUNNING
    assert robot.get_observation().refused == 9
    normals, offsets = half_planes(lab.setup.seat.reach)
    assert (np.array(places) @ normals.T + offsets).min() > 0.0
    assert abs(robot.get_observation().z) < 0.001


def test_a_command_that_fails_to_come_is_braked(robot):
    drive(robot)
    last = time.monotonic()
    assert robot.get_observation().vy > 0.2
    assert wait_for(lambda: robot.state is DriverState.HOLD)
    assert robot.fault is Fault.COMMAND_STALE
    assert 0.0 < robot.get_observation().braked_at - last < 0.3
    assert wait_for(lambda: abs(robot.get_observation().vy) < 0.01)
    robot.send_action(np.zeros(2), 0.05)
    assert wait_for(lambda: robot.state is DriverState.RUNNING)


@pytest.mark.slow
def test_a_protective_stop_is_released_by_word_alone(lab, robot, fault):
    drive(robot)
    fault("protective_stop")
    assert wait_for(lambda: robot.fault is Fault.PROTECTIVE_STOP)
    assert robot.state is DriverState.FAULT
    with pytest.raises(RobotError, match="not released"):
        robot.recover()
    time.sleep(2.5)
    robot.recover()
    assert robot.state is DriverState.READY
    robot.go_to(lab.setup.home)


@pytest.mark.slow
def test_an_emergency_stop_is_never_released(lab, robot, fault):
    drive(robot)
    fault("emergency_stop")
    assert wait_for(lambda: robot.fault is Fault.EMERGENCY_STOP)
    assert robot.state is DriverState.FAULT
    with pytest.raises(RobotError, match="pendant"):
        robot.recover()
    # A person releases it, and the driver still waits to be started again.
    lab.ask({"do": "fault", "name": "emergency_stop", "on": False})
    time.sleep(0.2)
    assert robot.state is DriverState.FAULT
    robot.disconnect()
    robot.connect()
    robot.go_to(lab.setup.home)


@pytest.mark.slow
def test_a_silent_robot_is_a_fault_and_gets_a_new_process(lab, robot, fault):
    drive(robot)
    fault("silent_robot")
    assert wait_for(lambda: robot.state is DriverState.FAULT)
    assert robot.fault is Fault.ROBOT_SILENT
    old = robot.pid
    lab.ask({"do": "fault", "name": "silent_robot", "on": False})
    robot.recover()
    assert robot.pid != old
    robot.go_to(lab.setup.home)


@pytest.mark.slow
def test_a_word_given_to_a_driver_is_not_for_the_next_one(lab, robot):
    def lose_program():
        drive(robot)
        # The controller's watchdog ends the program.
        os.kill(robot.pid, signal.SIGSTOP)
        time.sleep(0.2)
        os.kill(robot.pid, signal.SIGCONT)
        assert wait_for(lambda: robot.fault is Fault.PROGRAM_LOST)
        time.sleep(1.0)
        assert robot.state is DriverState.FAULT
        assert robot.fault is Fault.PROGRAM_LOST

    lose_program()
    robot.recover()
    robot.disconnect()
    robot.connect()
    lose_program()
    robot.recover()
    robot.go_to(lab.setup.home)


@pytest.mark.slow
def test_a_lifted_paddle_is_held_until_somebody_lets_go(lab, robot, fault):
    drive(robot, np.zeros(2), 24)
    fault("puck_under_paddle")

    def held():
        robot.send_action(UP, 0.05)
        return robot.state is DriverState.HOLD

    assert wait_for(held)
    assert robot.fault is Fault.PADDLE_LIFTED
    lab.ask({"do": "fault", "name": "puck_under_paddle", "on": False})
    drive(robot, times=4)
    assert robot.state is DriverState.HOLD
    robot.disable()
    assert wait_for(lambda: robot.state is DriverState.READY)
    robot.go_to(lab.setup.home)


def test_a_driver_that_is_killed_leaves_the_arm_at_rest(lab, robot):
    drive(robot)
    os.kill(robot.pid, signal.SIGKILL)
    assert wait_for(lambda: paddle_speed(lab) < 0.01)
    assert wait_for(lambda: not robot.is_connected)


@pytest.mark.slow
def test_a_caller_that_is_killed_leaves_nothing_behind(lab, tmp_path):
    code = tmp_path / "caller.py"
    code.write_text(
        "import time, numpy as np\n"
        "from marl_airhockey.hardware.robot import RobotConfig, Robot\n"
        "from marl_airhockey.hardware.robot import RobotConfig\n"
        "from marl_airhockey.hardware.lab.setup import LabSetup\n"
        "def main():\n"
        "    setup = LabSetup()\n"
        f"    config = RobotConfig({lab.host!r}, setup.mounting, setup.seat.reach)\n"
        "    with Robot(config) as robot:\n"
        "        robot.go_to(setup.home)\n"
        "        print(robot.pid, flush=True)\n"
        "        k = 0\n"
        "        while True:\n"
        "            k += 1\n"
        "            robot.send_action(np.array([0.0, 0.5 * (-1) ** (k // 8)]), 0.05)\n"
        "            time.sleep(0.05)\n"
        "if __name__ == '__main__':\n"
        "    main()\n"
    )
    command = [sys.executable, code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as caller:
        driver = int(caller.stdout.readline())
        assert wait_for(lambda: paddle_speed(lab) > 0.2)
        caller.kill()
    assert wait_for(lambda: paddle_speed(lab) < 0.01)
    assert wait_for(lambda: not runs(driver))


def test_no_arm_is_no_traceback(lab):
    with pytest.raises(RobotError, match="no arm answers"):
        Robot(replace(config_of(lab), host="127.0.0.99")).connect()
