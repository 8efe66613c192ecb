"""What every driver owes, in every scenario it can play."""

import numpy as np
import pytest
from pair import Pair

import marl_airhockey as ah
from marl_airhockey.registry import driver_class, make_driver
from marl_airhockey.sim.core.rng import StreamSet


def play(scenario, agent, worlds, steps, seed, **keywords):
    drivers = {"paddle_0": agent}
    world = ah.make_world(scenario, worlds, drivers=drivers, **keywords)
    world.reset(seed)
    command = []
    for _ in range(steps):
        world.step(np.zeros((worlds, len(world.open), 2)))
        command.append(world.command)
    return np.array(command)


def test_it_plays_every_scenario_finitely_and_repeatably(agent, scenario):
    bare = ah.make_world(scenario, 1)
    bare.reset(0)
    if driver_class(agent).needs_goal and "goal" not in bare.memory:
        with pytest.raises(ValueError, match="no goal"):
            play(scenario, agent, 2, 1, 0)
        return
    first = play(scenario, agent, 5, 60, 3)
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(first, play(scenario, agent, 5, 60, 3))
    np.testing.assert_array_equal(first[:, 2:3], play(scenario, agent, 1, 60, 5))


def test_it_plays_both_ends_alike(agent):
    """Ego frames: a driver mirrored to the far end does the mirrored thing."""
    if agent == "reacher":
        pytest.skip("needs a goal")
    worlds = {}
    for me, other in ((0, 1), (1, 0)):
        drivers = {f"paddle_{me}": agent, f"paddle_{other}": "still"}
        worlds[me] = ah.make_world(Pair(), 3, drivers=drivers)
        worlds[me].reset(1)
    near, far = worlds[0], worlds[1]
    # Rotate the far world's start by 180 degrees; seats then swap.
    flipped, everywhere = near.state, np.arange(3)
    for name in ("position", "velocity"):
        getattr(flipped, name)[:] = -getattr(near.state, name)[:, [1, 0, 2]]
    far.set_state(flipped)
    for world, seat in ((near, 0), (far, 1)):
        driven, streams = world.driven[seat], StreamSet(3, "same")
        streams.renew(everywhere, near.seeds, near.seeds)
        driven._purpose, driven._streams = "same", streams
    for _ in range(40):
        near.step(np.zeros((3, 0, 2)))
        far.step(np.zeros((3, 0, 2)))
        if near.memory["goals"].any():
            break  # The serve after a goal is drawn by each for itself.
        np.testing.assert_allclose(near.command[:, 0], -far.command[:, 1], atol=1e-9)


def test_a_driver_keeps_its_own_pace():
    driver = ah.make_driver("random")
    driver.control_dt = 0.15
    world = ah.make_world("reach", 2, drivers={"paddle_0": driver})
    world.reset(0)
    action = []
    for _ in range(9):
        world.step(np.zeros((2, 0, 2)))
        action.append(world.action[:, 0].copy())
    for k in range(0, 9, 3):
        np.testing.assert_array_equal(action[k], action[k + 2])
    assert not np.array_equal(action[0], action[3])
    driver.control_dt = 0.07
    with pytest.raises(ValueError, match="multiple"):
        ah.make_world("reach", 2, drivers={"paddle_0": driver})


def test_a_prescribed_paddle_follows_its_driver():
    class Hand(type(ah.make_driver("still"))):
        def measured(self):
            return np.array([[-0.5, 0.1, 0.2, 0.0]])

    world = ah.make_world(Pair(), 1, drivers={"paddle_1": Hand()})
    world.reset(0)
    world.step(np.zeros((1, 1, 2)))
    np.testing.assert_allclose(world.command[0, 1], [-0.2, 0.0], atol=1e-12)
    # Prescribed in the ego frame of the far seat, 180 degrees from the table's.
    np.testing.assert_allclose(world.state.paddle[0, 1], [0.5, -0.1], atol=1e-12)
    np.testing.assert_allclose(
        world.state.paddle_velocity[0, 1], [-0.2, 0.0], atol=1e-12
    )


def score(first, second, games=60):
    """Wins and half the draws of the first, as a share."""
    drivers = {"paddle_0": first, "paddle_1": second}
    world = ah.make_world("duel", games, backend="numba", drivers=drivers)
    world.autoreset, goals = False, np.zeros((games, 2))
    world.reset(7)
    playing = np.ones(games, bool)
    while playing.any():
        step = world.step(np.zeros((games, 0, 2)))
        goals[playing] = world.memory["goals"][playing]
        playing &= ~(step.terminated | step.truncated)
    return (np.sign(goals[:, 0] - goals[:, 1]) / 2 + 0.5).mean()


# Goalkeepers of all strengths keep all shots out while seats see without delay.
@pytest.mark.slow
@pytest.mark.parametrize("script", ["striker", "allround"])
def test_a_stronger_opponent_plays_better(script):
    names = [f"{script}:strength={level}" for level in ("weak", "fair", "strong")]
    scores = [score(name, "striker") for name in names]
    assert scores == sorted(scores)
    assert scores[-1] > scores[0] + 0.2
    assert score(names[0], "random") > 0.7


def test_options_of_a_driver_are_named_when_they_are_wrong():
    with pytest.raises(ValueError, match="unknown strength 'strog'"):
        make_driver("striker:strength=strog")
    with pytest.raises(ValueError, match="expected NAME=VALUE"):
        make_driver("striker:weak")
    with pytest.raises(ValueError, match="power"):
        make_driver("striker:power=weak")
