"""Spins of pucks with a mark, as a camera and its filter see them."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.build import build_world
from marl_airhockey.sim.sensing.puck_mark import PERIOD, wrapped

LEVEL = {
    **{"preset": "frictionless", "tilt": 0.0, "puck_drag": 0.0},
    **{"observation_delay": 0.04, "observation_jitter": 0.0167},
}


def spinning(spin, worlds=1, **physics):
    """Worlds with a puck that spins in the middle of a level table."""
    world = ah.make_world(
        "touch",
        worlds,
        physics={**LEVEL, **physics},
        observe="estimate",
        max_cycles=999,
    )
    world.reset(0)
    state, memory = world.get_state()
    state.puck[:], state.puck_velocity[:] = 0.0, 0.0
    state.position[:, 0], state.velocity[:, 0] = (-0.65, 0.0), 0.0
    state.spin[:, 1] = spin
    world.set_state(state, memory)
    return world


def step(world, count=1):
    """Estimated spin and orientation of each puck after some steps (B,), (B,)."""
    for _ in range(count):
        world.step(np.zeros((world.num_worlds, 1, 2)))
    found = world.sensor.camera._estimator.now[:, 0]
    return found[:, 4] / world.scene.table.puck_radius, found[:, 5]


@pytest.mark.parametrize("spin", [-60.0, -20.0, 0.0, 3.0, 40.0])
def test_the_spin_of_a_marked_puck_is_measured(spin):
    world = spinning(spin, 200, angle_noise=0.05)
    found, angle = step(world, 12)
    off = found - spin
    assert np.abs(off.mean()) < 0.2
    assert off.std() < 0.5
    turned = [wrapped(a) for a in angle - world.state.angle[:, 1]]
    assert np.std(turned) < 0.08


def test_the_spin_of_a_puck_without_a_mark_is_unknown():
    found, _ = step(spinning(20.0), 12)
    assert found[0] == 0.0


def test_marks_that_are_seldom_read_are_enough():
    found, _ = step(spinning(20.0, 200, angle_noise=0.05, angle_dropout=0.8), 25)
    assert np.median(np.abs(found - 20.0)) < 0.5


def test_noise_of_a_mark_is_that_of_the_parameter():
    first, _ = step(spinning(0.0, 400, angle_noise=0.02))
    later, _ = step(spinning(0.0, 400, angle_noise=0.2))
    assert 5.0 < later.std() / first.std() < 15.0


def test_marks_change_no_other_number():
    worlds = [spinning(20.0, 50, position_noise=0.001, angle_noise=a) for a in (0, 0.1)]
    for _ in range(5):
        for world in worlds:
            world.step(np.zeros((50, 1, 2)))
        seen, marked = (world.sensed for world in worlds)
        np.testing.assert_array_equal(seen.position, marked.position)
        np.testing.assert_array_equal(seen.velocity, marked.velocity)


def test_estimates_in_play_contain_most_of_the_spin():
    shares = []
    for noise in (0.0, 0.05):
        physics = {"angle_noise": noise, "angle_dropout": 0.1}
        keywords = {"profile": "ur5e", "observe": "estimate", "physics": physics}
        world = build_world("juggle", 200, True, keywords)
        world.reset(0)
        rng, pairs = np.random.default_rng(0), []
        for _ in range(100):
            world.step(rng.uniform(-1.0, 1.0, (200, 1, 2)))
            estimate = world.sensor.estimated(world.sensed)
            pairs.append((world.state.puck_edge, estimate.puck_edge))
        true, found = np.array(pairs)[..., 0].swapaxes(0, 1)
        shares.append(1.0 - np.mean((true - found) ** 2) / true.var())
    without, with_mark = shares
    assert without < 0.5
    assert with_mark > 0.9


def test_angles_are_wrapped_to_half_a_period():
    angles = np.linspace(-20.0, 20.0, 401)
    found = np.array([wrapped(a) for a in angles])
    assert np.abs(found).max() <= PERIOD / 2
    np.testing.assert_allclose(np.exp(2j * found), np.exp(2j * angles), atol=1e-12)
