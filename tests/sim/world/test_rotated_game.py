"""A rotated duel is the same duel, bit for bit, until a puck is served."""

from dataclasses import replace

import numpy as np

import marl_airhockey as ah

WORLDS, STEPS = 64, 90
OTHER = [1, 0, 2]
"""Paddles change seats; the puck is last"""


def duels(**keywords):
    world = ah.make_world("duel", WORLDS, **keywords)
    world.autoreset = False
    world.reset(1)
    return world


def rotated(state):
    """Return a state rotated by 180 degrees around the middle of the table."""
    place, motion = state.position[:, OTHER], state.velocity[:, OTHER]
    return replace(state, position=0.0 - place, velocity=0.0 - motion)


def test_a_rotated_duel_has_the_same_bits():
    one, two = (duels(physics={"tilt": 0.0}) for _ in range(2))
    two.set_state(rotated(one.state), two.memory)
    actions = np.random.default_rng(0).uniform(-1, 1, (STEPS, WORLDS, 2, 2))
    played, contacts = np.ones(WORLDS, np.bool_), 0
    for action in actions:
        one.step(action)
        two.step(action[:, ::-1])
        # Pucks are served at x = 0, and the sine of their heading is rounded.
        played &= one.state.puck[:, 0, 0] != 0.0
        contacts += one.state.touched[played].sum() + one.state.banked[played].sum()
        found = rotated(two.state)
        for name in ("position", "velocity"):
            real, other = getattr(one.state, name), getattr(found, name)
            np.testing.assert_array_equal(other[played], real[played])
    assert played.sum() > WORLDS / 4
    assert contacts > 200
