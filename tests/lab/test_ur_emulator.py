"""The emulator as a command: the clients of ur_rtde, faults, bad input."""

import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

from marl_airhockey.cli.main import app
from marl_airhockey.lab.ur_controller.emulator import ScheduledFault

rtde_receive = pytest.importorskip("rtde_receive")
rtde_control = pytest.importorskip("rtde_control")

ADDRESS = "127.0.0.28"
NORMAL, PROTECTIVE = 1, 4
"""Safety status bits"""


@contextmanager
def emulator(*words):
    command = [sys.executable, "-m", "marl_airhockey.cli", "ur-emulator"]
    with subprocess.Popen(
        [*command, "--address", ADDRESS, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as started:
        try:
            line = started.stdout.readline()
            while line and ADDRESS not in line:
                line = started.stdout.readline()
            assert line, "it ended before it answered"
            yield
        finally:
            started.terminate()


def until(condition, seconds=5.0):
    """Return True as soon as a condition holds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def switch(*words):
    result = CliRunner().invoke(app, ["ur-emulator", "fault", *words])
    assert result.exit_code == 0, result.exception
    return result.output


def test_a_client_moves_the_arm_and_meets_faults_on_demand():
    with emulator():
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS, 125.0)
        control = rtde_control.RTDEControlInterface(ADDRESS, 125.0)
        pose = receive.getActualTCPPose()
        goal = [*pose[:2], pose[2] + 0.02, *pose[3:]]
        assert control.moveL(goal, 0.1, 0.5)
        assert receive.getActualTCPPose()[2] == pytest.approx(goal[2], abs=1e-3)
        shown = switch("protective_stop", "--address", ADDRESS)
        assert "safety PROTECTIVE_STOP" in shown
        assert until(lambda: receive.getSafetyStatusBits() == PROTECTIVE)
        switch("protective_stop", "--off", "--address", ADDRESS)
        assert until(lambda: receive.getSafetyStatusBits() == NORMAL)
        switch("silent_robot", "--address", ADDRESS)
        time.sleep(0.1)
        silent = receive.getTimestamp()
        time.sleep(0.3)
        assert receive.getTimestamp() == silent
        switch("silent_robot", "--off", "--address", ADDRESS)
        assert until(lambda: receive.getTimestamp() > silent)
        control.disconnect()
        receive.disconnect()


def test_a_scheduled_fault_comes_and_goes():
    with emulator("--fault", "protective_stop@1.5s-2.5s"):
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS, 125.0)
        assert receive.getSafetyStatusBits() == NORMAL
        assert until(lambda: receive.getSafetyStatusBits() == PROTECTIVE)
        assert until(lambda: receive.getSafetyStatusBits() == NORMAL)
        receive.disconnect()


def test_a_dropped_connection_is_refused_until_it_is_over():
    with emulator():
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS, 125.0)
        switch("dropped_connection", "--address", ADDRESS)
        assert until(lambda: not receive.isConnected())
        switch("dropped_connection", "--off", "--address", ADDRESS)
        again = rtde_receive.RTDEReceiveInterface(ADDRESS, 125.0)
        assert again.isConnected()
        again.disconnect()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--address", "10.0.0.1"], "is no loopback address"),
        (["--fault", "fire@3s"], "unknown fault 'fire'"),
        (["--fault", "silent_robot"], "expected NAME@3s"),
        (["--fault", "silent_robot@3s-2s"], "must end after it begins"),
        (["fault", "silent_robot", "--address", "127.0.0.99"], "none is running"),
    ],
)
def test_bad_input_is_named(words, reason):
    result = CliRunner().invoke(app, ["ur-emulator", *words])
    assert reason in str(result.exception)


def test_a_taken_address_is_named():
    with emulator():
        result = CliRunner().invoke(app, ["ur-emulator", "--address", ADDRESS])
        assert "is taken" in str(result.exception)


def test_times_of_a_fault_are_in_seconds():
    assert ScheduledFault.parse("silent_robot@3s") == ("silent_robot", 3.0, None)
    assert ScheduledFault.parse("silent_robot@0.5-1.5") == ("silent_robot", 0.5, 1.5)
