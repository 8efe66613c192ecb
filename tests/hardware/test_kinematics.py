"""A UR5e's kinematics: closed forms, and back."""

import numpy as np
import pytest

from marl_airhockey.hardware.lab.setup import TOOL, LabSetup
from marl_airhockey.hardware.robot.kinematics import (
    forward,
    inverse,
    pose_of,
    pose_vector,
)
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES


def test_stretched_out_it_is_as_long_as_its_links():
    pose, _ = forward(np.zeros(6))
    np.testing.assert_allclose(
        pose[:3, 3], [-0.8172, -0.1333 - 0.0996, 0.1625 - 0.0997], atol=1e-9
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_jacobian_is_the_derivative(seed):
    angles = np.random.default_rng(seed).uniform(-2.0, 2.0, 6)
    pose, jacobian = forward(angles)
    for k in range(6):
        moved = angles.copy()
        moved[k] += 1e-6
        change = (forward(moved)[0][:3, 3] - pose[:3, 3]) / 1e-6
        np.testing.assert_allclose(change, jacobian[:3, k], atol=1e-5)


def test_the_inverse_finds_the_pose_near_the_guess():
    rng = np.random.default_rng(1)
    for _ in range(50):
        angles = rng.uniform([-3, -2, 1, -3, -2, -3], [3, -1, 2, -1, -1, 3])
        pose, _ = forward(angles)
        found, back = inverse(pose, angles + rng.normal(0.0, 0.05, 6))
        assert found
        np.testing.assert_allclose(forward(back)[0], pose, atol=1e-7)


def test_out_of_reach_is_told():
    pose, _ = forward(np.zeros(6))
    pose[0, 3] -= 0.2
    assert not inverse(pose, np.zeros(6))[0]


def test_a_pose_is_the_same_as_a_vector():
    rng = np.random.default_rng(2)
    for _ in range(50):
        pose, _ = forward(rng.uniform(-3.0, 3.0, 6))
        np.testing.assert_allclose(pose_of(pose_vector(pose)), pose, atol=1e-7)


def test_the_whole_reach_is_held_at_top_speed():
    setup = LabSetup()
    arm = setup.make_arm()
    tool = np.linalg.inv(pose_of(np.array(TOOL)))
    table = np.array(setup.mounting.rotation)
    worst = 0.0
    for corner in make_seat("robot", TABLES["full_size"], 0).reach:
        angles = arm.angles
        for share in np.linspace(0.0, 1.0, 12):
            place = setup.home + share * (np.array(corner) - setup.home)
            found, angles = inverse(pose_of(setup.mounting.pose(place)) @ tool, angles)
            assert found
        pose, jacobian = forward(angles)
        lever = (pose @ pose_of(np.array(TOOL)))[:3, 3] - pose[:3, 3]
        jacobian[:3] += np.cross(jacobian[3:].T, lever).T
        for way in np.linspace(0.0, 2 * np.pi, 16):
            twist = np.zeros(6)
            twist[:3] = 0.7 * table @ (np.cos(way), np.sin(way), 0.0)
            worst = max(worst, np.abs(np.linalg.solve(jacobian, twist)).max())
    assert worst < np.pi
