"""Filters of commands: what each of them does to a step and to chatter."""

import numpy as np
import pytest

from marl_airhockey.hardware.robot.filters import FILTERS, JerkLimited, Smoothing

DT, STEP, TIME = 0.008, 0.05, 0.05
SMOOTH = [name for name in FILTERS if name != "none"]


def filtered(name, commands, time=TIME):
    """Velocities (n, 2) that a filter reaches, as the shaper would, cycle by cycle."""
    made = Smoothing(name, time).make(DT)
    made.reset(np.zeros(2))
    velocity, found = np.zeros(2), []
    for command in commands:
        for left in np.arange(STEP, 1e-9, -DT):
            target = made.step(np.asarray(command, float), left)
            share = min(1.0, DT / target.seconds) if target.seconds else 1.0
            velocity = velocity + share * (target.velocity - velocity)
            found.append(velocity)
    return np.array(found)


@pytest.mark.parametrize("name", FILTERS)
def test_a_step_is_reached_and_passed_by_two_percent_at_most(name):
    found = filtered(name, [(0.5, -0.3)] * 20)
    np.testing.assert_allclose(found[-1], (0.5, -0.3), atol=0.005)
    assert found[:, 0].max() <= 0.51
    assert found[:, 0].min() >= 0.0
    across = found @ np.array([0.3, 0.5])
    np.testing.assert_allclose(across, 0.0, atol=1e-9)


@pytest.mark.parametrize("name", SMOOTH)
def test_chatter_changes_the_velocity_less(name):
    chatter = [(0.7 * (-1) ** k, 0.0) for k in range(40)]

    def variation(filter_name):
        return np.abs(np.diff(filtered(filter_name, chatter)[:, 0])).sum()

    assert variation(name) < 0.9 * variation("none")


def test_a_longer_time_is_slower():
    for name in SMOOTH:
        reached = [
            filtered(name, [(0.6, 0.0)] * 3, time)[-8, 0] for time in (0.02, 0.2)
        ]
        assert reached[0] > reached[1] + 0.1, name


def test_the_low_pass_has_its_time_constant():
    made = Smoothing("low_pass", 0.1).make(0.0005)
    made.reset(np.zeros(2))
    for _ in range(200):
        target = made.step(np.array([1.0, 0.0]), 0.0)
    assert target.velocity[0] == pytest.approx(1.0 - np.exp(-1.0), abs=0.002)


def test_the_jerk_is_limited():
    rng = np.random.default_rng(0)
    found = filtered("jerk_limited", rng.uniform(-0.7, 0.7, (60, 2)))
    acceleration = np.diff(found, axis=0) / DT
    jerk = np.linalg.norm(np.diff(acceleration, axis=0), axis=1) / DT
    assert jerk.max() <= JerkLimited.ACCELERATION / TIME * (1 + 1e-9)


def test_minimum_jerk_ends_its_control_step_with_no_acceleration():
    made = Smoothing("minimum_jerk", 0.0).make(0.001)
    made.reset(np.zeros(2))
    velocities = [
        made.step(np.array([0.6, 0.0]), 0.05 - 0.001 * k).velocity[0] for k in range(50)
    ]
    # From rest that is the cubic 3 s^2 - 2 s^3.
    s = np.arange(1, 51) / 50
    np.testing.assert_allclose(velocities, 0.6 * (3 * s**2 - 2 * s**3), atol=0.02)


@pytest.mark.parametrize(
    ("name", "time", "reason"),
    [
        ("median", 0.05, "unknown filter 'median'"),
        ("low_pass", -0.1, "time: .*number from 0 to 1"),
        ("low_pass", float("nan"), "time: .*number from 0 to 1"),
    ],
)
def test_bad_input_is_named(name, time, reason):
    with pytest.raises(ValueError, match=reason):
        Smoothing(name, time)
