"""Pucks that are brought forward over a reaction."""

import numpy as np
import pytest
from situations import idle

import marl_airhockey as ah
from marl_airhockey.registry import make_scenario
from marl_airhockey.sim.core.extrapolation import Walls, extrapolate, extrapolate_rows
from marl_airhockey.sim.core.table import Table

BOX = Table.rectangle(2.0, 1.0)


def walls(restitution=0.5, friction=0.0, table=BOX):
    return Walls(table.normals, table.offsets - 0.1, restitution, friction)


def test_free_pucks_go_straight_and_walls_return_a_share():
    place = np.array([(0.0, 0.0), (0.0, 0.3), (0.8, 0.0)])
    motion = np.array([(1.0, -0.5), (2.0, 1.0), (1.0, 0.0)])
    there, moved = extrapolate(place, motion, 0.3, walls())
    expected = [(0.3, -0.15), (0.6, 0.4 - 0.2 * 0.5), (0.9 - 0.2 * 0.5, 0.0)]
    np.testing.assert_allclose(there, expected, atol=1e-12)
    np.testing.assert_allclose(moved, [(1.0, -0.5), (2.0, -0.5), (-0.5, 0.0)])


def test_friction_slows_along_a_wall_until_the_slip_ends():
    place, motion = np.array([(0.0, 0.4)]), np.array([(1.5, 1.0)])
    _, slid = extrapolate(place, motion, 1e-9, walls(0.5, 0.1))
    np.testing.assert_allclose(slid, [(1.5 - 0.1 * 1.5, -0.5)])
    _, stuck = extrapolate(place, motion, 1e-9, walls(0.5, 1.0))
    np.testing.assert_allclose(stuck, [(1.0, -0.5)])


def test_a_corner_returns_both_ways_and_a_long_flight_stays_inside():
    place, motion = np.array([(0.85, 0.35)]), np.array([(1.0, 1.0)])
    there, moved = extrapolate(place, motion, 0.1, walls())
    np.testing.assert_allclose(there, [(0.9 - 0.025, 0.4 - 0.025)])
    np.testing.assert_allclose(moved, [(-0.5, -0.5)])
    rng = np.random.default_rng(0)
    place = rng.uniform((-0.9, -0.4), (0.9, 0.4), (500, 2))
    there, _ = extrapolate(place, rng.normal(0.0, 12.0, (500, 2)), 0.4, walls(0.9))
    assert (np.abs(there) <= (0.9 + 1e-9, 0.4 + 1e-9)).all()


@pytest.mark.parametrize(
    "name", ["duel", pytest.param("free_for_all", marks=pytest.mark.slow)]
)
def test_it_is_what_a_world_does_but_for_drag_and_spin(name, backend):
    world = ah.make_world(name, 200, backend=backend)
    world.reset(0)
    rng = np.random.default_rng(1)
    rows, kept = world.get_state()
    rows.puck[:, 0] = rng.uniform(-0.25, 0.25, (200, 2))
    rows.puck_velocity[:, 0] = 2.0 * rng.uniform(-1.0, 1.0, (200, 2))
    rows.spin[:] = 0.0
    world.set_state(rows, kept)
    scene = world.scene
    there, _ = extrapolate(rows.puck, rows.puck_velocity, 0.15, Walls.of(scene))
    free = np.ones(200, bool)
    for _ in range(3):
        idle(world, 0.05)
        met = world.state.touched.any((1, 2)) | world.state.crossed.any((1, 2))
        free &= ~met
    missed = np.hypot(*(world.state.puck - there)[free, 0].T)
    assert free.sum() > 150
    assert np.median(missed) < 0.003
    assert np.quantile(missed, 0.9) < 0.02


def test_seats_with_a_reaction_see_pucks_as_they_were_and_would_be_now():
    world = ah.make_world("duel", 64, options={"reaction": 0.15}, physics={})
    world.reset(0)
    rng = np.random.default_rng(2)
    rows, kept = world.get_state()
    rows.paddle[:] = [(-0.8, 0.2), (0.8, -0.2)]
    rows.puck[:, 0] = rng.uniform(-0.2, 0.2, (64, 2))
    rows.puck_velocity[:, 0] = 1.5 * rng.uniform(-1.0, 1.0, (64, 2))
    rows.spin[:] = 0.0
    world.set_state(rows, kept)
    seen = [idle(world, 0.05)[0].observation for _ in range(3)][-1]
    labels = list(world.observer.layout.labels)
    place = [labels.index(f"puck_0.{axis}") for axis in "xy"]
    now = [labels.index(f"puck_0.predicted.{axis}") for axis in "xy"]
    np.testing.assert_allclose(seen[:, 0, place], rows.puck[:, 0], atol=1e-6)
    missed = np.hypot(*(seen[:, 0, now] - world.state.puck[:, 0]).T)
    assert np.median(missed) < 0.003
    np.testing.assert_allclose(seen[:, 1, now], -world.state.puck[:, 0], atol=0.05)
    gap = [labels.index(f"own_to_puck_0.d{axis}") for axis in "xy"]
    own = world.state.paddle[:, 0]
    np.testing.assert_allclose(seen[:, 0, gap], seen[:, 0, now] - own, atol=1e-6)


@pytest.mark.parametrize("name", ["duel", "free_for_all"])
def test_compiled_rows_equal_numpy(name):
    scene = make_scenario(name).scene
    rng, sides = np.random.default_rng(2), Walls.of(scene)
    place = rng.uniform(-0.25, 0.25, (50, 2, 2))
    motion = rng.normal(0.0, 6.0, (50, 2, 2))
    for got, expected in zip(
        extrapolate_rows(place, motion, 0.3, sides),
        extrapolate(place, motion, 0.3, sides),
        strict=True,
    ):
        np.testing.assert_allclose(got, expected, atol=1e-12)
