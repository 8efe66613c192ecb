"""Estimates of pucks from a camera's frames, against the truth."""

import numpy as np
import pytest
from situations import place_puck

import marl_airhockey as ah

LATE = {"observation_delay": 0.04, "observation_jitter": 0.0}
LEVEL = {"preset": "frictionless", "tilt": 0.0, "wall_restitution": 0.8}


def puck_at(place, velocity, worlds=1, **physics):
    """Return worlds with a puck on its way, which the estimator follows."""
    world = ah.make_world(
        "touch",
        worlds,
        physics={**LEVEL, **LATE, **physics},
        observe="estimate",
        max_cycles=999,
    )
    world.reset(0)
    place_puck(world, *place, *velocity, paddle=(-0.65, 0.0))
    return world


def step(world):
    """Take a step and return the estimated and the true puck, (B, 4) each."""
    world.step(np.zeros((world.num_worlds, 1, 2)))
    shown = world.sensor.estimated(world.sensed)
    return [
        np.concatenate([s.puck[:, 0], s.puck_velocity[:, 0]], -1)
        for s in (shown, world.state)
    ]


def test_a_late_frame_is_brought_forward():
    world = puck_at((0.6, 0.0), (-0.8, 0.1))
    for _ in range(10):
        estimate, truth = step(world)
        np.testing.assert_allclose(estimate, truth, atol=1e-6)
    sensed = world.sensed.puck[:, 0]
    assert np.linalg.norm(sensed - truth[:, :2]) > 0.03


def test_the_slope_and_drag_are_known():
    world = puck_at((0.2, 0.0), (1.0, 0.2), tilt=5.5, puck_drag=0.03)
    for k in range(12):
        estimate, truth = step(world)
        if k < 3:  # What came before the first state knew no slope.
            continue
        np.testing.assert_allclose(estimate, truth, atol=2e-3)


def test_a_bank_is_known_before_a_frame_shows_it():
    world = puck_at((0.3, 0.15), (0.0, 0.9))
    for _ in range(12):
        before, _ = step(world)
        if world.state.puck_velocity[0, 0, 1] < 0.0:
            break
    estimate, truth = step(world)
    np.testing.assert_allclose(estimate, truth, atol=5e-3)
    assert before[0, 3] == pytest.approx(-0.72, abs=1e-2)


def test_a_hit_is_known_before_a_frame_shows_it():
    # The puck arrives at a still paddle between two steps.
    world = puck_at((-0.35, 0.0), (-1.0, 0.0), paddle_restitution=0.6)
    seen_late = False
    for _ in range(10):
        estimate, truth = step(world)
        if truth[0, 2] > 0.0:
            seen_late |= world.sensed.puck_velocity[0, 0, 0] < 0.0
            np.testing.assert_allclose(estimate, truth, atol=2e-2)
    assert seen_late
    assert truth[0, 2] == pytest.approx(0.6)


def test_what_no_law_explains_is_believed_after_two_frames():
    # Pushed by hand: nothing the estimator knows of changes this velocity.
    world = puck_at((0.3, 0.0), (0.5, 0.0))
    step(world)
    backend, state = world.backend, world._state
    state.velocity[:, 1] = (-0.5, 0.3)
    backend.reset(state, np.arange(1))
    for _ in range(3):
        estimate, truth = step(world)
    np.testing.assert_allclose(estimate[:, :2], truth[:, :2], atol=5e-3)
    np.testing.assert_allclose(estimate[:, 2:], truth[:, 2:], atol=5e-2)


def test_noise_is_averaged():
    world = puck_at((-0.2, -0.1), (0.4, 0.05), worlds=400, position_noise=0.002)
    estimates, sensed = [], []
    for _ in range(14):
        estimate, truth = step(world)
        estimates.append(estimate[:, 2:] - truth[:, 2:])
        sensed.append(world.sensed.puck_velocity[:, 0] - truth[:, 2:])
    # Differences of two frames are off by sqrt(2) 2 mm / 50 ms.
    assert np.std(sensed[-1]) == pytest.approx(0.0566, rel=0.1)
    assert np.std(estimates[-1]) < 0.25 * np.std(sensed[-1])


def test_a_single_wrong_detection_is_not_believed():
    world = puck_at((-0.2, -0.1), (0.3, 0.05), worlds=200, false_detection=0.05)
    off, seen = [], []
    for _ in range(14):
        estimate, truth = step(world)
        off.append(np.linalg.norm(estimate[:, :2] - truth[:, :2], axis=-1))
        seen.append(np.linalg.norm(world.sensed.puck[:, 0] - truth[:, :2], axis=-1))
    assert np.mean(np.array(seen) > 0.1) > 0.03
    # Those near the puck, and the second of two in a row, are believed for a while.
    assert np.mean(np.array(off) > 0.1) < 0.35 * np.mean(np.array(seen) > 0.1)


def test_an_occluded_puck_goes_on():
    world = puck_at((-0.6, 0.2), (0.05, -0.2), worlds=300, occlusion=0.5)
    for _ in range(8):
        estimate, truth = step(world)
    hidden = ~world.sensed.visible[:, 0]
    assert hidden.mean() > 0.3
    np.testing.assert_allclose(estimate[hidden], truth[hidden], atol=3e-3)


def test_the_observation_shows_the_estimate_the_frame_and_pending_actions():
    world = ah.make_world("touch", 4, profile="ur5e", observe="estimate")
    first = world.reset(3)
    labels = list(world.observer.labels)
    assert labels[:8] == [
        *("own.x", "own.y", "own.vx", "own.vy"),
        *(
            "own.requested[-2].x",
            "own.requested[-2].y",
            "own.requested[-1].x",
            "own.requested[-1].y",
        ),
    ]
    begin = labels.index("puck_0.x")
    names = ("x", "y", "vx", "vy", "spin", "seen", "age")
    assert labels[begin : begin + 7] == [f"puck_0.{name}" for name in names]
    shown = first[:, 0, begin : begin + 7]
    estimated = world.sensor.estimated(world.sensed)
    np.testing.assert_allclose(shown[:, :2], estimated.puck[:, 0], atol=1e-6)
    assert ((shown[:, 6] > 0.02) & (shown[:, 6] < 0.07)).all()


def test_rows_estimate_as_single_worlds_do():
    many = ah.make_world("juggle", 5, profile="ur5e", observe="estimate")
    many.reset([7, 8, 9, 10, 11])
    one = ah.make_world("juggle", 1, profile="ur5e", observe="estimate")
    one.reset([9])
    rng = np.random.default_rng(0)
    for _ in range(120):
        action = rng.uniform(-1.0, 1.0, (5, 1, 2))
        a, b = many.step(action), one.step(action[2:3])
        np.testing.assert_array_equal(a.observation[2], b.observation[0])


def test_in_the_ideal_profile_it_is_the_truth():
    world = ah.make_world("touch", 3, observe="estimate")
    world.reset(0)
    estimate, truth = step(world)
    np.testing.assert_array_equal(estimate, truth)


@pytest.mark.usefixtures("uncompiled")
def test_every_scenario_shows_estimates(scenario):
    world = ah.make_world(scenario, 2, profile="ur5e", observe="estimate")
    world.reset(0)
    for _ in range(3):
        result = world.step(np.zeros((2, len(world.open), 2)))
    assert result.observation.shape[-1] == len(world.observer.labels)
    assert np.isfinite(result.observation).all()
