"""Pointing: a paddle comes to rest where somebody points, one that is late as well."""

import numpy as np
import pytest

import marl_airhockey as ah

SERVO = {"action_delay": 0.01, "servo_time": 0.08}


def places(driver, physics, steps=80):
    """Return where a paddle is, (steps, 2) m, that is pointed 0.1 m ahead."""
    world = ah.make_world(
        "reach", 1, drivers={"paddle_0": driver}, physics=physics, max_cycles=200
    )
    world.reset(0)
    start = world.state.paddle[0, 0].copy()
    target = start + np.array([0.08, 0.06])
    driver.aim(*target)  # Seat 0 looks along x: its ego frame is the table's.
    found = []
    for _ in range(steps):
        world.step(np.zeros((1, 0, 2)))
        found.append(world.state.paddle[0, 0] - target)
    world.close()
    return np.array(found)


@pytest.mark.parametrize(
    ("lag", "physics"), [(0.0, {}), (0.1, {}), (0.1, SERVO)], ids=str
)
def test_it_comes_to_rest_there(lag, physics):
    off = np.linalg.norm(places(ah.make_driver(f"mouse:lag={lag}"), physics), axis=1)
    assert off[40:].max() < 0.004


def test_without_prediction_a_late_paddle_swings():
    off = np.linalg.norm(places(ah.make_driver("mouse"), SERVO), axis=1)
    assert off[40:].max() > 0.004
