"""The emulator as a command: the clients of ur_rtde, faults, bad input."""

import socket
import struct
import time

import numpy as np
import pytest
from emulators import ADDRESS, emulator, status, switch, until
from typer.testing import CliRunner

from marl_airhockey.cli.main import app
from marl_airhockey.hardware.robot.limits import read_limits
from marl_airhockey.hardware.ur_emulator.emulator import ScheduledFault
from marl_airhockey.hardware.ur_emulator.ports import EXTERNAL_CONTROL

rtde_receive = pytest.importorskip("rtde_receive")
rtde_control = pytest.importorskip("rtde_control")
rtde_io = pytest.importorskip("rtde_io")
dashboard_client = pytest.importorskip("dashboard_client")

OTHER = "127.0.0.29"
NORMAL, PROTECTIVE = 1, 4
"""Safety status bits"""


def external_control_is_free():
    """Return whether the port that the client of External Control serves is free.

    It is of the range that the system gives to connections of any other test.
    """
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("", EXTERNAL_CONTROL))
        except OSError:
            return False
    return True


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


@pytest.mark.slow
def test_every_emulated_call_of_the_control_client_answers():
    with emulator():
        control = rtde_control.RTDEControlInterface(ADDRESS, 500.0)
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS, 500.0)
        pose, angles = receive.getActualTCPPose(), receive.getActualQ()
        tool = control.getTCPOffset()
        assert tool == pytest.approx([0, 0, 0.12, 0, 0, 0])
        assert control.getForwardKinematics() == pytest.approx(pose, abs=1e-4)
        of_angles = control.getForwardKinematics(angles, tool)
        assert of_angles == pytest.approx(pose, abs=1e-4)
        assert control.getInverseKinematics(pose) == pytest.approx(angles, abs=1e-4)
        near = control.getInverseKinematics(pose, angles)
        assert near == pytest.approx(angles, abs=1e-4)
        assert control.getInverseKinematicsHasSolution(pose)
        assert control.isPoseWithinSafetyLimits(pose)
        assert not control.isPoseWithinSafetyLimits([3.0, *pose[1:]])
        assert control.isSteady()
        assert control.setPayload(0.6, [0, 0, 0.06])
        assert control.zeroFtSensor()
        turned = [*angles[:5], angles[5] + 0.1]
        assert control.moveJ(turned, 0.5, 1.0)
        assert receive.getActualQ() == pytest.approx(turned, abs=2e-3)
        assert control.moveJ_IK(pose, 0.5, 1.0)
        assert receive.getActualQ() == pytest.approx(angles, abs=2e-3)
        assert control.speedJ([0, 0, 0, 0, 0, 0.2], 2.0, 0.0)
        assert until(lambda: receive.getActualQd()[5] > 0.19)
        assert control.speedStop(5.0)
        assert control.servoJ(angles, 0.5, 0.5, 0.008, 0.05, 300)
        assert until(lambda: abs(receive.getActualQ()[5] - angles[5]) < 1e-3)
        assert control.servoStop(5.0)
        assert control.speedL([0, 0.05, 0, 0, 0, 0], 0.5, 0.0)
        assert until(lambda: receive.getActualTCPSpeed()[1] > 0.04)
        assert control.speedStop(5.0)
        control.stopScript()
        assert until(lambda: receive.getRuntimeState() == 1)
        assert control.reuploadScript()
        control.disconnect()
        receive.disconnect()


@pytest.mark.slow
def test_the_speed_slider_slows_motion_and_outputs_are_read_back():
    with emulator():
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS, 125.0)
        io = rtde_io.RTDEIOInterface(ADDRESS)
        assert io.setStandardDigitalOut(3, True)
        assert until(lambda: receive.getDigitalOutState(3))
        assert io.setStandardDigitalOut(3, False)
        assert until(lambda: not receive.getDigitalOutState(3))
        assert io.setSpeedSlider(0.5)
        assert until(lambda: receive.getSpeedScaling() == 0.5)
        control = rtde_control.RTDEControlInterface(ADDRESS, 125.0)
        control.speedL([0, 0.1, 0, 0, 0, 0], 1.0, 0.0)
        assert until(lambda: receive.getActualTCPSpeed()[1] > 0.045)
        time.sleep(0.2)
        assert receive.getActualTCPSpeed()[1] == pytest.approx(0.05, abs=2e-3)
        for client in (control, io, receive):
            client.disconnect()


def test_the_dashboard_looks_after_the_robot():
    with emulator():
        board = dashboard_client.DashboardClient(ADDRESS)
        board.connect()
        assert board.polyscopeVersion().startswith("5.12.2")
        assert board.isInRemoteControl()
        assert board.robotmode() == "Robotmode: RUNNING"
        assert board.safetystatus() == "Safetystatus: NORMAL"
        switch("protective_stop", "--address", ADDRESS)
        with pytest.raises(RuntimeError, match="until 5s after"):
            board.unlockProtectiveStop()
        switch("local_control", "--address", ADDRESS)
        assert not board.isInRemoteControl()
        with pytest.raises(RuntimeError, match="enable remote control"):
            rtde_control.RTDEControlInterface(ADDRESS, 125.0)
        switch("power_off", "--address", ADDRESS)
        assert board.robotmode() == "Robotmode: POWER_OFF"
        board.disconnect()


@pytest.mark.slow
def test_external_control_gets_its_script_from_the_client():
    """The constructor's arguments are those of the authors' own robot code."""
    assert until(external_control_is_free, 30.0)
    with emulator():
        flags = rtde_control.RTDEControlInterface.FLAG_USE_EXT_UR_CAP
        control = rtde_control.RTDEControlInterface(ADDRESS, 500.0, flags)
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS)
        pose = receive.getActualTCPPose()
        assert control.isPoseWithinSafetyLimits(pose)
        assert control.servoL(pose, 0.8, 0.8, 0.049, 0.2, 700)
        control.forceMode(
            *(pose, [0, 0, 1, 0, 0, 0], [0, 0, 5.0, 0, 0, 0], 2),
            [2, 2, 1.5, 1, 1, 1],
        )
        assert until(lambda: receive.getActualTCPForce()[2] > 4.0)
        assert control.servoStop(6.0)
        control.disconnect()
        receive.disconnect()


def test_the_upper_range_of_registers_works_too():
    with emulator():
        flags = (
            rtde_control.RTDEControlInterface.FLAG_UPLOAD_SCRIPT
            | rtde_control.RTDEControlInterface.FLAG_UPPER_RANGE_REGISTERS
        )
        control = rtde_control.RTDEControlInterface(ADDRESS, 500.0, flags)
        assert control.isSteady()
        assert control.getTCPOffset() == pytest.approx([0, 0, 0.12, 0, 0, 0])
        control.disconnect()


@pytest.mark.slow
def test_two_robots_run_side_by_side():
    with emulator(), emulator(at=OTHER):
        clients = [
            rtde_receive.RTDEReceiveInterface(host, 125.0) for host in (ADDRESS, OTHER)
        ]
        switch("protective_stop", "--address", OTHER)
        assert until(lambda: clients[1].getSafetyStatusBits() == PROTECTIVE)
        assert clients[0].getSafetyStatusBits() == NORMAL
        for client in clients:
            client.disconnect()


def test_a_client_in_plain_python_streams_and_writes():
    """RTDE as its documentation says, with nothing of ur_rtde."""
    with emulator(), socket.create_connection((ADDRESS, 30004), 5.0) as link:
        file = link.makefile("rb")

        def receive():
            size, kind = struct.unpack(">HB", file.read(3))
            return kind, file.read(size - 3)

        def exchange(kind, body):
            link.sendall(struct.pack(">HB", 3 + len(body), kind) + body)
            answered, answer = receive()
            assert answered == kind
            return answer

        assert exchange(ord("V"), struct.pack(">H", 2)) == b"\x01"
        assert struct.unpack(">4I", exchange(ord("v"), b""))[:3] == (5, 12, 2)
        names = b"timestamp,actual_TCP_pose,safety_mode"
        setup = exchange(ord("O"), struct.pack(">d", 125.0) + names)
        assert setup == b"\x01DOUBLE,VECTOR6D,INT32"
        unknown = exchange(ord("I"), b"input_int_register_0,no_such_name")
        assert unknown == b"\x00INT32,NOT_FOUND"
        assert exchange(ord("S"), b"") == b"\x01"
        stamps = []
        while len(stamps) < 20:
            kind, body = receive()
            assert kind == ord("U")
            stamp, *pose, mode = struct.unpack(">d6di", body[1:])
            assert mode == 1
            assert np.isfinite(pose).all()
            stamps.append(stamp)
        np.testing.assert_allclose(np.diff(stamps), 0.008, atol=1e-9)


@pytest.mark.parametrize("port", [30001, 30002, 30012])
def test_the_state_with_the_joint_limits_is_sent(port):
    with emulator():
        limits = read_limits(ADDRESS, port)
        np.testing.assert_allclose(limits.speed, np.pi)


def test_the_status_names_safety_program_and_commands():
    with emulator():
        switch("protective_stop", "--address", ADDRESS)
        words = ["ur-emulator", "status", "--address", ADDRESS]
        shown = CliRunner().invoke(app, words).output
        assert "PROTECTIVE_STOP" in shown
        assert "stopped" in shown


@pytest.mark.slow
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
        (["--address", "10.0.0.1"], "expected a loopback address"),
        (["--fault", "fire@3s"], "unknown fault 'fire'"),
        (["--fault", "silent_robot"], "expected NAME@3s"),
        (["--fault", "silent_robot@3s-2s"], "must end after it begins"),
        (["--polyscope", "old"], "expected a version"),
        (
            ["fault", "silent_robot", "--address", "127.0.0.99"],
            "no emulator is running",
        ),
    ],
)
def test_bad_input_is_named(words, reason):
    result = CliRunner().invoke(app, ["ur-emulator", *words])
    assert reason in str(result.exception)


def test_a_taken_address_is_named():
    with emulator():
        result = CliRunner().invoke(app, ["ur-emulator", "--address", ADDRESS])
        assert "is taken" in str(result.exception)
        assert status(), "the one that runs is still found"


def test_times_of_a_fault_are_in_seconds():
    assert ScheduledFault.parse("silent_robot@3s") == ("silent_robot", 3.0, None)
    assert ScheduledFault.parse("silent_robot@0.5-1.5") == ("silent_robot", 0.5, 1.5)
