"""Physics that a world draws from, and the profiles."""

import csv
from pathlib import Path

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.sim.core.parameters import PARAMETERS, PRESETS
from marl_airhockey.sim.core.physics import Physics
from marl_airhockey.sim.core.profiles import PROFILES, RAMP, delay_of
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.table import GRAVITY


def drawn(worlds=4000, base=None, **keywords):
    """Return physics and many draws of it."""
    physics, rows = Physics(base or {}, **keywords), np.arange(worlds)
    return physics, physics.draw(RandomStreams.keyed(rows, rows, "physics"))


def test_physics_ranges_are_drawn_anew_for_every_episode():
    world = ah.make_world(
        "touch", 32, physics={"puck_damping": (0.1, 0.9), "tilt": 4.0}
    )
    world.reset(0)
    first = world.episode.physics["puck_damping"].copy()
    assert ((first >= 0.1) & (first <= 0.9)).all()
    assert np.ptp(first) > 0.3
    assert (world.episode.physics["tilt"] == 4.0).all()
    world.reset()
    assert not np.array_equal(first, world.episode.physics["puck_damping"])
    world.reset(0)
    np.testing.assert_array_equal(first, world.episode.physics["puck_damping"])


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_names_parameters_within_their_bounds(name):
    profile = PROFILES[name]
    for key, pair in profile.ranges.items():
        assert PARAMETERS[key].low <= pair[0] <= pair[1] <= PARAMETERS[key].high
    for key in (*profile.shares, *profile.follows):
        assert key in PARAMETERS
    assert not set(profile.ranges) & (set(profile.shares) | set(profile.follows))
    physics, values = drawn(profile=name)
    for key, value in values.items():
        if key not in ("tilt", "cross_tilt"):
            low, high = physics.ranges[key]
            assert low - 1e-12 <= value.min() <= value.max() <= high + 1e-12


def test_profiles_do_not_change_seats():
    for name in PROFILES:
        for seats, top in (("robot", (0.7, 7.0)), ("arcade", (5.0, 50.0))):
            world = ah.make_world("reach", profile=name, seats=seats)
            ranges = world.physics.ranges
            assert ranges["paddle_speed"] == (top[0], top[0])
            assert ranges["paddle_acceleration"] == (top[1], top[1])


def test_the_delays_of_the_profiles_are_those_that_were_measured():
    low, high = delay_of(PROFILES["ur5e"])
    assert low == pytest.approx(RAMP + 0.079, abs=1e-3)
    assert high == pytest.approx(RAMP + 0.172, abs=1e-3)
    authors = RAMP + np.array([0.25, 0.35])
    assert delay_of(PROFILES["ur5e-authors"]) == pytest.approx(authors, abs=0.01)
    # Round trip of the gantry: 13.1 .. 22.0 ms, to which its loop adds up to 3.
    gantry = RAMP + np.array([0.0134, 0.0247])
    assert delay_of(PROFILES["gantry"]) == pytest.approx(gantry, abs=1e-3)
    assert delay_of(PROFILES["ideal"]) == (RAMP, RAMP)


def test_measured_answers_lie_within_the_delays_of_the_profiles():
    path = Path(__file__).parents[3] / "docs/data/answer_times.csv"
    with path.open() as file:
        rows = {row["profile"]: row["answer_ms"] for row in csv.DictReader(file)}
    assert set(rows) == set(PROFILES)
    for name, answer in rows.items():
        measured = [float(cell) for cell in answer.split(" .. ")]
        low, high = (1000 * end for end in delay_of(PROFILES[name]))
        # The slowest parts rarely come together.
        assert low - 1 <= measured[0] < low + 10
        assert high - 10 < measured[-1] <= high + 1


def test_lively_rails_lose_little_with_speed():
    _, values = drawn(profile="ur5e")
    e, slope = values["wall_restitution"], values["wall_restitution_slope"]
    line = 0.08 - 0.07 * (e - 0.65) / 0.23
    assert np.abs(slope - line).max() <= 0.01
    assert np.ptp(slope - line) > 0.019
    both = {"preset": "wooden"}, {"wall_restitution_slope": 0.02}
    for given, wanted in zip(both, (0.07, 0.02), strict=True):
        _, values = drawn(profile="ur5e", given=given)
        assert (values["wall_restitution_slope"] == wanted).all()


def test_tables_slope_a_little_in_any_direction():
    _, values = drawn(profile="gantry", base={"tilt": 0.0})
    pulls = GRAVITY * np.sin(np.radians([values["tilt"], values["cross_tilt"]]))
    np.testing.assert_allclose(pulls.std(1), 0.04, rtol=0.05)
    np.testing.assert_allclose(pulls.mean(1), 0.0, atol=0.003)
    _, values = drawn(profile="ur5e", given={"slope": 0.0})
    pull = GRAVITY * np.sin(np.radians(values["tilt"]))
    assert 0.685 < pull.min() < 0.70
    assert 0.95 < pull.max() < 0.965


def test_what_the_user_says_overrides_the_profile():
    physics, _ = drawn(profile="ur5e", given={"preset": "wooden", "tilt": 3.0})
    for name, value in PRESETS["wooden"].items():
        assert physics.ranges[name] == (value, value)
    assert physics.ranges["tilt"] == (3.0, 3.0)
    assert physics.ranges["servo_time"] == (0.05, 0.10)
