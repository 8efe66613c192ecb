"""What sensors make of the truth, against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from situations import place_puck

import marl_airhockey as ah
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.sensing.calibration import CalibrationMap
from marl_airhockey.sim.sensing.sensor import Needs, Sensor

LEVEL = {"preset": "frictionless", "tilt": 0.0}
DT = 0.05


def drifting(worlds, velocity=(0.1, 0.05), **physics):
    """Return worlds in which a puck drifts over a level table, far from all walls."""
    world = ah.make_world(
        "touch", worlds, physics={**LEVEL, **physics}, observe="history", max_cycles=999
    )
    world.reset(0)
    place_puck(world, 0.1, -0.1, *velocity, paddle=(-0.65, 0.0))
    return world


def still(world):
    """Take a step in which no paddle moves."""
    world.step(np.zeros((world.num_worlds, 1, 2)))


def lag(world):
    """Return how old (s) the place is at which each puck is seen, along its way."""
    velocity = world.state.puck_velocity[:, 0]
    gap = world.state.puck[:, 0] - world.sensed.puck[:, 0]
    return (gap * velocity).sum(-1) / (velocity * velocity).sum(-1)


def test_a_constant_delay_shows_the_past():
    world = drifting(3, observation_delay=0.033)
    for _ in range(8):
        still(world)
        np.testing.assert_allclose(lag(world), 0.033, atol=1e-9)
        np.testing.assert_allclose(
            world.sensed.puck_velocity, world.state.puck_velocity, atol=1e-9
        )
        np.testing.assert_allclose(world.sensor.history[:, -1, 0, 3], 0.033)


@pytest.mark.parametrize("delay", [0.02, 0.07, 0.12])
def test_a_bank_within_a_step_is_seen_where_it_was(delay):
    # Speed 0.9 m/s at a wall of restitution 0.9: the way is known in closed form.
    world = drifting(12, (0.0, 0.9), observation_delay=delay)
    state, _ = world.get_state()
    state.position[:, 1, 1] = np.linspace(0.0, 0.04, 12)
    world.set_state(state)
    half = world.scene.table.size[1] / 2 - world.scene.table.puck_radius
    begin, time, banked = state.position[:, 1, 1], 0.0, 0
    for _ in range(14):
        still(world)
        time += DT
        place = begin + 0.9 * (time - delay)
        way = np.where(place > half, half - 0.9 * (place - half), place)
        np.testing.assert_allclose(world.sensed.puck[:, 0, 1], way, atol=1e-9)
        hit = begin + 0.9 * time > half
        banked += (hit & (begin + 0.9 * (time - DT) < half)).sum()
    assert banked == 12


def test_a_delay_is_drawn_for_an_episode_and_a_jitter_for_a_step():
    world = drifting(400, observation_delay=(0.02, 0.04), observation_jitter=0.0167)
    ages = []
    for _ in range(40):
        still(world)
        ages.append(lag(world))
        shown = world.sensor.history[:, -1, 0, 3]
        np.testing.assert_allclose(shown, ages[-1], atol=1e-9)
        # Frames know when they were taken: jitter does not disturb velocities.
        np.testing.assert_allclose(
            world.sensed.puck_velocity, world.state.puck_velocity, atol=1e-9
        )
    ages = np.array(ages)
    delay = world.episode.physics["observation_delay"]
    within = ages - delay
    assert within.min() >= 0.0
    assert within.max() <= 0.0167 + 1e-9
    assert within.mean() == pytest.approx(0.0167 / 2, rel=0.03)
    assert within.std() == pytest.approx(0.0167 / 12**0.5, rel=0.03)
    assert np.ptp(delay) > 0.018


def test_white_noise_has_its_deviation():
    world = drifting(400, velocity=(0.0, 0.0), position_noise=0.002)
    errors = []
    for _ in range(20):
        still(world)
        errors.append(world.sensed.puck - world.state.puck)
    errors = np.array(errors)
    assert errors.std() == pytest.approx(0.002, rel=0.03)
    assert abs(np.corrcoef(errors[:-1].ravel(), errors[1:].ravel())[0, 1]) < 0.03


def test_a_calibration_map_is_smooth_and_stays_for_an_episode():
    world = drifting(300, velocity=(0.0, 0.0), calibration_error=0.003)
    still(world)
    shift = world.sensed.puck - world.state.puck
    assert shift.std() == pytest.approx(0.003, rel=0.1)
    for _ in range(5):
        still(world)
    np.testing.assert_allclose(world.sensed.puck - world.state.puck, shift)
    first = np.arange(500)
    maps = CalibrationMap(500, 0.6)
    maps.sample(RandomStreams.keyed(first, first, "map"), np.full(500, 0.01), first)
    here = np.tile([0.1, -0.2], (500, 1, 1))
    apart = np.array([0.0, 0.01, 0.05, 0.2, 0.6])
    there = [here + np.array([d, 0.0]) for d in apart]
    error = [maps.shifted(place, first) - place for place in there]
    alike = [np.corrcoef(error[0].ravel(), e.ravel())[0, 1] for e in error]
    assert alike[1] > 0.99
    assert alike[2] > 0.75
    assert abs(alike[4]) < 0.5
    assert np.std(error) == pytest.approx(0.01, rel=0.05)


def test_a_serve_keeps_the_map_of_the_episode():
    world = ah.make_world("duel", 1, physics={"calibration_error": 0.01})
    world.reset(0)
    state, memory = world.get_state()
    state.position[:, 2], state.velocity[:, 2] = (0.80, 0.0), (2.0, 0.0)
    state.position[:, 1] = (0.6, 0.25)
    place, here = np.zeros((1, 1, 2)), np.arange(1)
    before = world.sensor.camera.calibration.shifted(place, here)
    world.set_state(state, memory)
    fresh = world.sensor.camera.calibration.shifted(place, here)
    assert (fresh != before).any()
    for _ in range(3):
        world.step(np.zeros((1, 2, 2)))
    assert world.memory["goals"].sum() == 1
    kept = world.sensor.camera.calibration.shifted(place, here)
    np.testing.assert_array_equal(kept, fresh)


def test_a_puck_near_the_arm_is_hidden_for_its_share_of_time():
    far = drifting(50, velocity=(0.0, 0.0), occlusion=0.3)
    near = drifting(200, velocity=(0.0, 0.0), occlusion=0.3)
    state, memory = near.get_state()
    state.position[:, 1] = (-0.55, 0.15)
    near.set_state(state, memory)
    seen = []
    for _ in range(400):
        still(near)
        still(far)
        assert far.sensed.visible.all()
        seen.append(near.sensed.visible[:, 0])
    hidden = ~np.array(seen)[20:]
    assert hidden.mean() == pytest.approx(0.3, abs=0.01)
    ends = hidden[:-1] & ~hidden[1:]
    # A chain of two states leaves with dt / 0.1 s at every step.
    assert hidden[:-1].sum() / ends.sum() * DT == pytest.approx(0.1, rel=0.05)


def test_what_is_hidden_stays_and_its_velocity_after_it_is_right():
    world = drifting(300, velocity=(0.02, 0.03), occlusion=0.3)
    state, memory = world.get_state()
    state.position[:, 1] = (-0.55, 0.15)
    world.set_state(state, memory)
    for _ in range(25):
        before = world.sensed
        still(world)
        hidden = ~world.sensed.visible[:, 0]
        for name in ("puck", "puck_velocity"):
            held, past = getattr(world.sensed, name), getattr(before, name)
            np.testing.assert_array_equal(held[hidden], past[hidden])
        age = world.sensor.history[:, -1, 0, 3]
        assert (age[hidden] > 0.9 * DT).all()
        np.testing.assert_allclose(age[~hidden], 0.0, atol=1e-9)
        np.testing.assert_allclose(
            world.sensed.puck_velocity, world.state.puck_velocity, atol=1e-9
        )


def test_wrong_detections_are_as_many_as_asked_for():
    world = drifting(500, velocity=(0.0, 0.0), false_detection=0.05)
    wrong = []
    for _ in range(40):
        still(world)
        gap = np.linalg.norm(world.sensed.puck - world.state.puck, axis=-1)
        wrong.append(gap > 1e-9)
        assert world.sensed.visible.all()
    assert np.mean(wrong) == pytest.approx(0.05, abs=0.005)


def test_a_history_shows_ages_and_the_actions_on_their_way():
    world = ah.make_world("touch", 2, profile="ur5e")
    assert world.observer.observe == "history"
    world.reset(0)
    asked = np.array([[[0.3, -0.2]], [[-0.5, 0.1]]])
    world.step(asked)
    shown = world.step(-asked).observation
    named = dict(zip(world.observer.layout.labels, shown[1, 0], strict=True))
    assert named["own.requested[-2].x"] == np.float32(-0.5)
    assert named["own.requested[-1].y"] == np.float32(-0.1)
    assert 0.025 <= named["puck_0[-0].age"] <= 0.0617


def test_sensing_costs_nothing_in_the_ideal_profile():
    world = ah.make_world("touch", 2)
    world.reset(0)
    world.step(np.zeros((2, 1, 2)))
    np.testing.assert_array_equal(world.sensed.position, world.state.position)
    np.testing.assert_array_equal(world.sensed.velocity, world.state.velocity)


def test_a_live_backend_gets_no_simulated_camera():
    world = ah.make_world("juggle", 1, profile="ur5e")
    world.reset(0)
    measured = np.array([[[0.1, 0.2, 1.0, 0.03]]])
    sensor = Sensor(
        *(world.scene, 1, world.physics, DT, Needs.of(["history"])),
        live=SimpleNamespace(sight=lambda: measured),
    )
    assert sensor.ideal
    state, physics = world.state, world.episode.physics
    sensed = sensor.reset(np.zeros(1, np.int64), state, physics, world._streams)
    np.testing.assert_array_equal(sensed.position, state.position)
    np.testing.assert_array_equal(sensor.history[:, -1], measured)


def test_needs_are_collected_from_all_forms():
    assert Needs.of(["velocity"]) == Needs(history=False, estimate=False)
    assert Needs.of(["velocity", "history"]) == Needs(history=True, estimate=False)
    assert Needs.of(["estimate"]) == Needs(history=True, estimate=True)
    world = ah.make_world("juggle", 1)
    with pytest.raises(ValueError, match="'history' is not one of"):
        world.observer.layout_of("history")
