"""What the table needs of an arm's joints, against what its controller allows."""

import dataclasses
import socket
import threading

import numpy as np
import pytest

from marl_airhockey.hardware.lab.setup import TOOL, LabSetup
from marl_airhockey.hardware.robot import limits
from marl_airhockey.hardware.ur_emulator.state import message, state_of

SETUP = LabSetup()
ARM = SETUP.make_arm()
WHOLE = np.full(6, 2 * np.pi)
JOINTS = limits.JointLimits(-WHOLE, WHOLE, np.full(6, np.pi), ARM.angles)


def check(joints, mounting=SETUP.mounting, speed=0.7):
    reach = np.array(SETUP.seat.reach)
    limits.check_reach(joints, mounting, np.array(TOOL), reach, speed)


def test_the_labs_table_is_within_its_arms_limits():
    check(JOINTS)


def test_joints_that_would_be_too_fast_are_named():
    slow = np.full(6, np.pi)
    slow[1] = 0.5
    with pytest.raises(ValueError, match=r"joint 1 needs \d+% of its speed limit"):
        check(JOINTS._replace(speed=slow))
    with pytest.raises(ValueError, match=r"needs \d+% of its speed limit"):
        check(JOINTS, speed=0.8)


def test_needed_speeds_are_those_of_the_arm_itself():
    """Against the simulated arm: its joints, moved so, move the tool at that speed."""
    arm = SETUP.make_arm()
    share = 0.0
    for angle in np.linspace(0, 2 * np.pi, 60):
        way = np.zeros(6)
        plane = np.array(SETUP.mounting.rotation)[:, :2]
        way[:3] = plane @ (np.cos(angle), np.sin(angle)) * 0.7
        arm._update_pose()
        speeds = np.linalg.solve(arm._jacobian, way)
        share = max(share, np.abs(speeds).max() / np.pi)
    tight = JOINTS._replace(speed=np.full(6, np.pi * share / limits.SHARE))
    home = SETUP.home + np.array([(0.0, 0.0), (1e-4, 0.0), (0.0, 1e-4)])
    around = SETUP.mounting, np.array(TOOL), home
    # The simulated arm stands two centimetres above the table.
    limits.check_reach(tight, *around, 0.67)
    with pytest.raises(ValueError, match="of its speed limit for"):
        limits.check_reach(tight, *around, 0.73)


def test_a_joint_beyond_its_angle_is_named():
    most = WHOLE.copy()
    most[2] = 1.5
    with pytest.raises(ValueError, match="joint 2 is beyond its limit"):
        check(JOINTS._replace(most=most))


def test_a_table_out_of_reach_is_named():
    far = dataclasses.replace(SETUP.mounting, origin=(2.5, 0.0, 0.0))
    with pytest.raises(ValueError, match="does not reach the table"):
        check(JOINTS, far)


@pytest.mark.parametrize(
    ("sent", "words"),
    [
        ([message(20, b"version")], "closed the connection"),
        (
            [message(20, b"")] + [message(16, message(0, b"x" * 38))] * 30,
            "no joint limits",
        ),
    ],
)
def test_a_controller_that_tells_no_limits_is_named(sent, words):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]

        def serve():
            link, _ = server.accept()
            with link:
                link.sendall(b"".join(sent))

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(OSError, match=words):
            limits.read_limits("127.0.0.1", port)


def test_limits_come_in_pieces():
    whole = state_of(ARM)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]

        def serve():
            link, _ = server.accept()
            with link:
                for k in range(0, len(whole), 100):
                    link.sendall(whole[k : k + 100])

        threading.Thread(target=serve, daemon=True).start()
        found = limits.read_limits("127.0.0.1", port)
    np.testing.assert_array_equal(found.angles, ARM.angles)
    np.testing.assert_array_equal(found.speed, np.full(6, np.pi))
    np.testing.assert_array_equal(found.least, -WHOLE)
