"""Physics that a world draws from."""

import numpy as np

import marl_airhockey as ah


def test_physics_ranges_are_drawn_anew_for_every_episode():
    world = ah.make_world(
        "touch", 32, physics={"puck_damping": (0.1, 0.9), "tilt": 4.0}
    )
    world.reset(0)
    first = world.episode.physics["puck_damping"].copy()
    assert ((first >= 0.1) & (first <= 0.9)).all()
    assert np.ptp(first) > 0.3
    assert (world.episode.physics["tilt"] == 4.0).all()
    world.reset()
    assert not np.array_equal(first, world.episode.physics["puck_damping"])
    world.reset(0)
    np.testing.assert_array_equal(first, world.episode.physics["puck_damping"])
