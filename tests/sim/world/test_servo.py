"""Servo: paddles lag as a second-order system does, and keep to their reaches."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.sim.core.servo import HALF

DT = 0.05


def response(time, frequency):
    """Return the answer of a critically damped lag to a ramp of slope 1, from rest."""
    t = np.maximum(time, 0.0)
    return t - 2 / frequency + (2 / frequency + t) * np.exp(-frequency * t)


@pytest.mark.parametrize("planar", ["numba", "pymunk"])
@pytest.mark.parametrize("half", [0.05, 0.1])
def test_the_step_response_is_that_of_the_lag(planar, half):
    world = ah.make_world("juggle", 1, backend=planar, physics={"servo_time": half})
    world.reset(0)
    state, _ = world.get_state()
    state.position[:, 0], state.velocity[:, 0] = (-0.62, -0.1), 0.0
    state.position[:, 1], state.velocity[:, 1] = (0.6, 0.0), (0.5, 0.0)
    world.set_state(state)
    asked = [(0.0, 0.5)] * 4 + [(0.0, 0.0)] * 6
    orders, speeds = [0.0], []
    for action in asked:
        world.step(np.array([[action]]))
        speeds.append(world.state.paddle_velocity[0, 0, 1])
        orders.append(0.7 * action[1])
    slopes = np.diff(orders) / DT
    bends = np.diff(slopes, prepend=0.0)
    times = DT * np.arange(1, len(asked) + 1)
    expected = [
        sum(bend * response(t - k * DT, HALF / half) for k, bend in enumerate(bends))
        for t in times
    ]
    np.testing.assert_allclose(speeds, expected, atol=1e-9)


def test_half_of_a_change_is_made_in_its_time():
    frequency = HALF / 0.08
    rise = 1 - (1 + frequency * 0.08) * np.exp(-frequency * 0.08)
    assert rise == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(("planar", "worlds"), [("numba", 256), ("pymunk", 6)])
@pytest.mark.parametrize("name", ["juggle", "duel"])
def test_what_lags_keeps_to_its_reach_speed_and_acceleration(name, planar, worlds):
    world = ah.make_world(
        name,
        worlds,
        backend=planar,
        physics={"servo_time": (0.0, 0.12)},
        options={"seats": "robot"},
    )
    world.autoreset = False
    world.reset(0)
    rng, normals, offsets = np.random.default_rng(0), world.reach.normals, world.reach
    actions, before = None, world.state.paddle_velocity
    for k in range(250):
        if k % 7 == 0:
            actions = np.sign(rng.uniform(-1, 1, (worlds, len(world.open), 2)))
        world.step(actions)
        place, velocity = world.state.paddle, world.state.paddle_velocity
        room = (normals * place[:, :, None]).sum(-1) + offsets.offsets
        assert room.min() > -1e-9
        assert np.linalg.norm(velocity, axis=-1).max() < 0.7 + 1e-9
        change = np.linalg.norm(world.command - before, axis=-1)
        assert change.max() / DT < 7.0 + 1e-6
        before = velocity


def test_without_a_servo_the_command_is_the_order():
    world = ah.make_world("juggle", 2)
    world.reset(0)
    assert world.control_step.now.commanded is world.control_step.now.realized


def test_an_arm_has_its_own_servo():
    pytest.importorskip("robosuite")
    world = ah.make_world("reach", 1, backend="robosuite", profile="ur5e")
    world.reset(0)
    assert world.control_step.now.commanded is world.control_step.now.realized
    world.close()
