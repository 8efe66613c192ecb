"""Contacts as they are sensed: late, and not exactly where they were."""

import numpy as np
import pytest
from situations import idle, place_puck

import marl_airhockey as ah
from marl_airhockey.sim.sensing.contacts import contact_time

LEVEL = {"preset": "frictionless", "tilt": 0.0}
DT = 0.05


def falling_onto_a_paddle(worlds, **physics):
    """Worlds in which a puck at 1 m/s meets a paddle at rest after 0.11 s."""
    world = ah.make_world(
        "juggle", worlds, physics={**LEVEL, **physics}, max_cycles=999
    )
    world.autoreset = False
    world.reset(0)
    near = world.scene.table.puck_radius + world.scene.table.paddle_radius
    place_puck(world, -0.5 + near + 0.11, 0.0, -1.0, paddle=(-0.5, 0.0))
    return world


def first(flags):
    """Index of the first step whose flag is set."""
    return int(np.argmax(flags))


@pytest.mark.parametrize(("delay", "late"), [(0.03, 1), (0.06, 1), (0.11, 2)])
def test_a_contact_is_known_when_a_frame_after_it_arrives(delay, late):
    """A frame 10 ms after it does not show yet that the puck has turned back."""
    world = falling_onto_a_paddle(1, observation_delay=delay)
    true, known, shown = [], [], []
    flag = world.observer.labels.index("armed_0")
    for _ in range(8):
        step = idle(world, DT)[0]
        true.append(world.state.touched.any())
        known.append(world.sensed.touched.any())
        shown.append(step.observation[0, 0, flag] > 0)
    assert first(true) == 2
    assert first(known) == first(shown) == 2 + late
    assert sum(known) == 1


def test_the_time_of_a_sensed_contact_is_that_of_the_contact():
    world = falling_onto_a_paddle(1, observation_delay=0.06)
    for step in range(5):
        idle(world, DT)
        if world.sensed.touched.any():
            at = step * DT + world.sensed.touched_at.item()
            assert at == pytest.approx(0.11, abs=DT / 8)
            return
    pytest.fail("no contact was sensed")


def test_what_observations_say_of_contacts_has_the_errors_of_the_camera():
    world = ah.make_world(
        "juggle", 200, profile="ur5e", observe="estimate",
        drivers={"paddle_0": "striker"},
    )  # fmt: skip
    world.autoreset = False
    world.reset(0)
    ahead, errors = 0, []
    for _ in range(60):
        world.step(np.zeros((200, 0, 2)))
        true, known = world.memory, world.known.memory
        ahead += (known["touches"] > true["touches"]).sum()
        both = (true["armed"] > 0) & (known["armed"] > 0)
        errors.append((known["struck_at"] - true["struck_at"])[both])
    assert ahead < 0.01 * 60 * 200
    errors = np.concatenate(errors)
    assert len(errors) > 500
    assert 0.001 < np.median(np.abs(errors)) < 0.1


def test_the_score_of_a_game_is_announced_and_possession_is_sensed():
    world = ah.make_world("duel", 100, profile="ur5e")
    world.autoreset = False
    world.reset(0)
    rng, action, different = np.random.default_rng(0), np.zeros((100, 2, 2)), 0
    for _ in range(300):
        action = np.clip(0.8 * action + 0.6 * rng.uniform(-1, 1, action.shape), -1, 1)
        world.step(action)
        true, known = world.memory, world.known.memory
        for name in world.scenario.announced:
            np.testing.assert_array_equal(known[name], true[name])
        different += (known["held"] != true["held"]).sum()
    assert true["goals"].any()
    assert different > 0


def test_without_simulated_sensing_the_memory_itself_is_shown():
    world = ah.make_world("juggle", 2)
    world.autoreset = False
    world.reset(0)
    idle(world, 1.0)
    for name, array in world.memory.items():
        np.testing.assert_array_equal(world.known.memory[name], array)


def test_a_puck_that_passes_a_paddle_has_no_contact_with_it():
    times, paddle = np.array([0.0, 0.1]), np.zeros((2, 2))
    before = np.array([0.0, -0.1, 0.09, 2.0, 0.0])
    after = np.array([0.1, 0.1, 0.09, 2.0, 0.0])
    assert np.isnan(contact_time(before, after, times, paddle, 0.08))
    before[2] = after[2] = 0.07
    assert np.isfinite(contact_time(before, after, times, paddle, 0.08))
