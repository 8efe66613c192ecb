"""The filter between all drivers and the paddles, against closed forms."""

import numpy as np
import pytest

from marl_airhockey.sim.core.limits import JERK, VIOLATIONS, Limited, limits_stage
from marl_airhockey.sim.core.seat import ReachPlanes, Seat, make_seat
from marl_airhockey.sim.core.table import TABLES

DT, SPEED, ACCELERATION = 0.05, 0.7, 7.0
TABLE = TABLES["standard"]
HOME = make_seat("robot", TABLE, 0)
CENTRE = (-0.55, 0.0)


def limit(
    action, position=CENTRE, velocity=(0.0, 0.0), last=(0.0, 0.0), seat=HOME, **more
):
    """What the limits make of one action of one seat."""
    after = Limited.empty(1, 1)
    prescribed = np.full((1, 1, 4), np.nan)
    prescribed[:] = more.get("prescribed", np.nan)
    rows = [np.array([[row]], float) for row in (action, position, velocity, last)]
    stage = limits_stage(
        rows[0],
        prescribed,
        tuple(rows[1:]),
        ReachPlanes.of(TABLE, (seat,)),
        (np.full(1, SPEED), np.full(1, ACCELERATION)),
        DT,
        after,
    )
    assert stage()
    names = dict(zip(VIOLATIONS, after.violation[0, 0], strict=True))
    return after.velocity[0, 0], after.acceleration[0, 0], names


def test_a_small_action_passes_as_it_is():
    velocity, acceleration, violation = limit((0.2, -0.3))
    np.testing.assert_allclose(velocity, [0.14, -0.21])
    np.testing.assert_allclose(acceleration, [2.8, -4.2])
    assert set(violation.values()) == {0.0}


def test_the_speed_is_cut_in_its_direction():
    velocity, _, violation = limit((3.0, 4.0), velocity=(0.42, 0.56))
    np.testing.assert_allclose(velocity, [0.42, 0.56])
    assert violation["speed"] == pytest.approx(5 * SPEED - SPEED, rel=1e-5)
    assert violation["acceleration"] == violation["jerk"] == violation["reach"] == 0.0
    assert violation["cost"] == pytest.approx(4.0, rel=1e-5)


def test_the_change_of_velocity_is_cut_in_its_direction():
    velocity, acceleration, violation = limit((0.8, 0.0), velocity=(0.0, -0.1))
    change = np.array([0.56, 0.1])
    norm = np.linalg.norm(change)
    np.testing.assert_allclose(
        velocity, [0.0, -0.1] + change / norm * ACCELERATION * DT, rtol=1e-12
    )
    assert np.linalg.norm(acceleration) == pytest.approx(ACCELERATION)
    beyond = norm / DT - ACCELERATION
    assert violation["acceleration"] == pytest.approx(beyond, rel=1e-5)
    assert violation["jerk"] == 0.0
    assert violation["cost"] == pytest.approx(beyond / ACCELERATION, rel=1e-5)


def test_the_jerk_beyond_a_full_reversal_is_counted_and_not_cut():
    allowed = JERK * ACCELERATION * DT
    # From full acceleration to three times the opposite one.
    velocity, _, violation = limit((-1.0, 0.0), (-0.5, 0), (0.35, 0), (ACCELERATION, 0))
    asked = (0.7 + 0.35) / DT
    np.testing.assert_allclose(velocity, [0.0, 0.0], atol=1e-12)
    jerk = (asked + ACCELERATION - allowed) / DT
    assert violation["jerk"] == pytest.approx(jerk, rel=1e-9)
    cost = (asked - ACCELERATION + jerk / JERK) / ACCELERATION
    assert violation["cost"] == pytest.approx(cost, rel=1e-5)
    _, _, calm = limit((0.5, 0.0), (-0.5, 0), (0.35, 0), (ACCELERATION, 0))
    assert calm["jerk"] == 0.0


def test_speed_toward_an_edge_is_what_can_still_brake():
    edge = max(y for _, y in HOME.reach)
    # Of the acceleration, so much may be planned against one edge of a corner.
    planned = ACCELERATION * ReachPlanes.of(TABLE, (HOME,)).share[0]
    for gap in (0.002, 0.01, 0.02):
        velocity, _, violation = limit((0.0, 0.9), (-0.6, edge - gap), (0.0, 0.3))
        room = gap - 0.5 * DT * 0.3
        stop = np.sqrt(DT**2 + 2 * max(room, 0.0) / planned) - DT
        wanted = 0.9 * SPEED
        fastest = max(planned * stop, 0.3 - planned * DT)
        assert fastest < wanted
        assert velocity[1] == pytest.approx(fastest, abs=1e-9)
        assert violation["reach"] == pytest.approx(wanted - fastest, abs=1e-9)


@pytest.mark.parametrize("seat", [HOME, make_seat("arcade", TABLE, 0, (2,))])
def test_no_action_leaves_the_reach(seat):
    rng = np.random.default_rng(0)
    planes = ReachPlanes.of(TABLE, (seat,))
    for _ in range(40):
        position, velocity, last = np.mean(seat.reach, axis=0), np.zeros(2), np.zeros(2)
        action = rng.uniform(-3, 3, 2)
        for k in range(60):
            if k % 7 == 0:
                action = rng.uniform(-3, 3, 2)
            new, last, _ = limit(action, position, velocity, last, seat)
            position, velocity = position + 0.5 * DT * (velocity + new), new
            ahead = planes.normals[0] @ position + planes.offsets[0]
            assert ahead.min() > -1e-9
            assert np.linalg.norm(velocity) <= SPEED * (1 + 1e-9)
            assert np.linalg.norm(last) <= ACCELERATION * (1 + 1e-9)


def test_a_corner_sharper_than_a_right_angle_is_kept_too():
    reach = ((-0.7, 0.2), (-0.7, -0.2), (-0.354, 0.0))
    seat = Seat(0, reach, SPEED, ACCELERATION)
    position, velocity, last = np.array([-0.6, 0.0]), np.zeros(2), np.zeros(2)
    planes = ReachPlanes.of(TABLE, (seat,))
    assert planes.passes > 1
    for _ in range(80):
        new, last, _ = limit((1.0, 0.1), position, velocity, last, seat)
        position, velocity = position + 0.5 * DT * (velocity + new), new
        assert (planes.normals[0] @ position + planes.offsets[0]).min() > -1e-6
    assert position[0] > -0.45


def test_a_prescribed_velocity_passes_whatever_it_is():
    velocity, acceleration, _ = limit((0, 0), prescribed=(-0.5, 0.0, 3.0, -2.0))
    np.testing.assert_array_equal(velocity, [3.0, -2.0])
    np.testing.assert_allclose(acceleration, [60.0, -40.0])


def test_actions_are_in_the_seats_own_frame():
    far = make_seat("robot", TABLE, 2)
    velocity, _, _ = limit((0.3, 0.2), (0.55, 0.0), seat=far)
    np.testing.assert_allclose(velocity, [-0.21, -0.14], atol=1e-12)


def test_an_action_that_is_not_finite_stops():
    for bad in (np.nan, np.inf):
        with pytest.raises(AssertionError):
            limit((bad, 0.0))
