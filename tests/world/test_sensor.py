"""What sensors make of the truth: delays, noise, occlusion."""

import numpy as np

import marl_airhockey as ah


def test_the_robot_profile_delays_and_blurs():
    sharp = ah.make_world("touch", 16, observe="velocity")
    blurred = ah.make_world("touch", 16, profile="robot", observe="velocity")
    assert ah.make_world("touch", profile="robot").observer.observe == "history"
    for world in (sharp, blurred):
        world.reset(0)
    labels = sharp.observer.layout.labels
    x = labels.index("puck_0.x")
    errors = []
    for _ in range(12):
        for world in (sharp, blurred):
            step = world.step(np.full((16, 1, 2), 0.5))
        errors.append(step.observation[:, 0, x] - blurred.state.puck[:, 0, 0])
    errors = np.array(errors)
    # 33 ms old: a falling puck is seen above where it is.
    assert 0.01 < np.median(errors) < 0.06
    assert (sharp.command[:, 0] != blurred.command[:, 0]).any()
    # One step of action delay: nothing moves in the first 50 ms.
    for world in (sharp, blurred):
        world.reset(0)
        world.step(np.full((16, 1, 2), 0.5))
    speed = np.linalg.norm(blurred.state.paddle_velocity[:, 0], axis=-1)
    full = np.linalg.norm(sharp.state.paddle_velocity[:, 0], axis=-1)
    assert (speed < 0.3 * full).all()


def test_occlusion_holds_what_was_seen():
    world = ah.make_world("touch", 64, physics={"occlusion": 0.3}, observe="history")
    world.reset(0)
    hidden = []
    for _ in range(30):
        world.step(np.zeros((64, 1, 2)))
        hidden.append(~world.sensed.visible[:, 0])
        held = world.sensor.history[hidden[-1], -1, 0, :2]
        before = world.sensor.history[hidden[-1], -2, 0, :2]
        np.testing.assert_array_equal(held, before)
    assert 0.2 < np.mean(hidden) < 0.4
