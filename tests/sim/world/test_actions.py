"""Seats that are out of the game."""

import numpy as np
from situations import idle, shoot

import marl_airhockey as ah


def test_a_goal_without_an_owner_is_a_wall_and_its_paddle_is_away(backend):
    world = ah.make_world("free_for_all", 2, backend=backend, options={"lives": 1})
    world.reset(0)
    shoot(world, 1)
    idle(world, 0.15)
    assert (world.memory["lives"] == [1, 0, 1, 1]).all()
    normal, offset = world.scene.table.normals[1], world.scene.table.offsets[1]
    assert (world.state.paddle[:, 1] @ normal < -offset).all()
    shoot(world, 1, 1.0)
    idle(world, 0.2)
    assert (world.memory["lives"] == [1, 0, 1, 1]).all()
    assert (world.state.puck_velocity[:, 0] @ normal > 0.5).all()
    # Whoever is out cannot act, and comes back with the next episode.
    action = np.ones((2, 4, 2))
    world.step(action)
    assert (world.state.paddle[:, 1] @ normal < -offset).all()
    world.reset(1)
    assert (world.state.paddle[:, 1] @ normal > -offset).all()
