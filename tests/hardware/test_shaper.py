"""The last filter before an arm: whatever comes in, what goes out can be followed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marl_airhockey.hardware.robot.shaper import MotionLimits, Shaper
from marl_airhockey.sim.core.geometry import half_planes
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES

REACH = make_seat("robot", TABLES["full_size"], 0).reach
LIMITS, DT = MotionLimits(), 0.008
wild = st.floats(-50.0, 50.0) | st.sampled_from([float("nan"), float("inf"), 0.0])


def shaped(commands, each=6, seconds=0.05):
    """Places, velocities and accelerations of a shaper, each command held so long."""
    shaper = Shaper(LIMITS, np.array(REACH), DT, np.array([-0.65, 0.05]))
    rows = []
    for command in commands:
        for k in range(each):
            shaper.step(np.array(command), max(seconds - k * DT, 0.0))
            rows.append((shaper.place, shaper.velocity, shaper.acceleration))
    return (np.array(column) for column in zip(*rows, strict=True))


def check_limits(place, velocity, acceleration):
    normals, offsets = half_planes(REACH)
    assert (place @ normals.T + offsets).min() > -1e-9
    assert np.linalg.norm(velocity, axis=1).max() <= LIMITS.speed * (1 + 1e-6)
    size = np.linalg.norm(acceleration, axis=1)
    assert size.max() <= LIMITS.acceleration * (1 + 1e-6)
    jerk = np.linalg.norm(np.diff(acceleration, axis=0), axis=1) / DT
    assert jerk.max() <= LIMITS.jerk * (1 + 1e-6)


@given(st.lists(st.tuples(wild, wild), min_size=20, max_size=60))
@settings(max_examples=40, deadline=None)
def test_wild_commands_stay_within_every_limit(commands):
    check_limits(*shaped(commands))


@given(st.lists(st.floats(0.0, 1.2), min_size=20, max_size=60), st.integers(2, 8))
@settings(max_examples=40, deadline=None)
def test_commands_that_turn_stay_within_every_limit(turns, each):
    """They take the most from what braking in front of an edge needs."""
    angles = np.cumsum(turns)
    commands = np.stack([np.cos(angles), np.sin(angles)], 1) * 9.0
    check_limits(*shaped(commands, each))


def test_who_begins_outside_comes_in():
    outside = np.array([-0.40, 0.0])
    shaper = Shaper(LIMITS, np.array(REACH), DT, outside)
    places = [shaper.step(np.array([0.7, 0.0]), 0.05) for _ in range(20)]
    assert max(x for x, _ in places) < outside[0] + 1e-6
    for _ in range(40):
        shaper.step(np.array([-0.7, 0.0]), 0.05)
    normals, offsets = half_planes(REACH)
    assert (normals @ shaper.place + offsets).min() > 0.0


def test_a_velocity_is_reached_when_it_is_asked_for():
    _, velocity, _ = shaped([(0.0, 0.2)] * 4)
    np.testing.assert_allclose(velocity[-1], [0.0, 0.2], atol=1e-3)
    assert velocity[6, 1] > 0.1


def test_a_stop_takes_what_it_says():
    shaper = Shaper(LIMITS, np.array(REACH), DT, np.array([-0.65, -0.3]))
    for _ in range(40):
        shaper.step(np.array([0.0, 0.7]), 0.05)
    began, steps = shaper.place.copy(), 0
    while np.linalg.norm(shaper.velocity) > 1e-3:
        shaper.brake()
        steps += 1
    way = np.linalg.norm(shaper.place - began)
    assert way < LIMITS.stopping_distance + 0.7 * DT + 0.01
    assert steps * DT < 0.7 / LIMITS.acceleration + 0.06


@pytest.mark.parametrize("name", ["speed", "acceleration", "jerk"])
def test_a_limit_that_is_none_is_named(name):
    with pytest.raises(ValueError, match=name):
        MotionLimits(**{name: 0.0})
