"""Scatter of contacts: as wide as asked for, and the same in one world and many."""

import copy
import pickle

import numpy as np
import pytest
from situations import place_puck

import marl_airhockey as ah
from marl_airhockey.sim.core.scatter import draw

LEVEL = {"preset": "frictionless", "tilt": 0.0, "wall_restitution": 0.7}
SCATTERS = {
    "wall_restitution_scatter": 0.04,
    "wall_exit_scatter": 0.1,
    "paddle_restitution_scatter": 0.05,
    "spin_scatter": 0.2,
}
PLANAR = pytest.mark.parametrize("planar", ["numba", "pymunk"])


def after(backend, place, velocity, paddle=(-0.65, 0.0), worlds=600, **physics):
    """Return states of many worlds after a puck has met something once."""
    world = ah.make_world("touch", worlds, backend=backend, physics=LEVEL | physics)
    world.autoreset = False
    world.reset(0)
    place_puck(world, *place, *velocity, paddle=paddle)
    for _ in range(3):
        world.step(np.zeros((worlds, 1, 2)))
    return world.state


@PLANAR
def test_bounces_scatter_as_asked(planar):
    wall = {"wall_restitution_scatter": 0.04, "wall_exit_scatter": 0.1}
    worlds = 20_000 if planar == "numba" else 600
    end = after(planar, (0.2, 0.2), (0.3, 1.5), worlds=worlds, **wall)
    e = -end.puck_velocity[:, 0, 1] / 1.5
    assert e.mean() == pytest.approx(0.7, abs=0.006)
    assert e.std() == pytest.approx(0.04, rel=0.1)
    along = end.puck_velocity[:, 0, 0] - 0.3
    # Of two normal laws, one in twenty five times as wide: half of all lie within 0.071
    # m/s, 3.0 % beyond 0.3 m/s.
    assert np.median(np.abs(along)) == pytest.approx(0.071, rel=0.12)
    assert (np.abs(along) > 0.3).mean() == pytest.approx(0.030, abs=0.015)


@PLANAR
def test_hits_scatter_as_asked(planar):
    hit = {"paddle_restitution_scatter": 0.05, "spin_scatter": 0.2}
    end = after(planar, (-0.45, 0.0), (-1.5, 0.0), paddle_restitution=0.55, **hit)
    e = end.puck_velocity[:, 0, 0] / 1.5
    assert e.mean() == pytest.approx(0.55, abs=0.008)
    assert e.std() == pytest.approx(0.05, rel=0.1)
    share = end.puck_edge[:, 0] / np.linalg.norm(end.puck_velocity[:, 0], axis=-1)
    assert share.std() == pytest.approx(0.2, rel=0.1)


@PLANAR
def test_nothing_scatters_unless_asked(planar):
    end = after(planar, (0.2, 0.2), (0.3, 1.5), worlds=3)
    assert (np.ptp(end.puck_velocity, axis=0) == 0.0).all()


@PLANAR
def test_a_row_scatters_as_its_single_world_and_copies_go_on(planar):
    many = ah.make_world("juggle", 4, backend=planar, physics=SCATTERS)
    many.reset(5)
    ones = [ah.make_world("juggle", backend=planar, physics=SCATTERS) for _ in "1234"]
    for i, one in enumerate(ones):
        one.reset(5 + i)
    rng, copies = np.random.default_rng(0), []
    for k in range(200):
        actions = rng.uniform(-1, 1, (4, 1, 2))
        if k == 80:
            copies = [copy.deepcopy(many), pickle.loads(pickle.dumps(many))]
        for world in (many, *copies):
            world.step(actions)
        for i, one in enumerate(ones):
            one.step(actions[i : i + 1])
            np.testing.assert_array_equal(one.state.position[0], many.state.position[i])
    for other in copies:
        np.testing.assert_array_equal(other.state.position, many.state.position)


def test_a_state_that_is_set_has_one_future():
    world = ah.make_world("juggle", 2, physics=SCATTERS)
    world.autoreset = False
    world.reset(0)
    state, memory = world.get_state()
    ends = []
    for _ in range(2):
        world.set_state(state, memory)
        for _ in range(60):
            world.step(np.zeros((2, 1, 2)))
        ends.append(world.state.position)
    np.testing.assert_array_equal(*ends)


def test_draws_are_normal_and_independent():
    keys = [np.uint64(7919 * k) for k in range(100)]
    drawn = np.array([draw(key, n, 3) for key in keys for n in range(50)])
    np.testing.assert_allclose(drawn[:, :2].std(0), 1.0, rtol=0.05)
    np.testing.assert_allclose(drawn[:, :2].mean(0), 0.0, atol=0.05)
    assert np.abs(np.corrcoef(drawn.T) - np.eye(3)).max() < 0.05
    assert abs(np.corrcoef(drawn[:-1, 0], drawn[1:, 0])[0, 1]) < 0.05
