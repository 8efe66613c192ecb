"""Observations that are pictures."""

import numpy as np

import marl_airhockey as ah


def test_pixels_show_the_table_and_change():
    env = ah.make_vec("hit_goal", 3, observe="pixels")
    seen, _ = env.reset(seed=0)
    assert seen.shape == (3, 84, 84, 3)
    assert seen.dtype == np.uint8
    for _ in range(4):
        later = env.step(np.ones((3, 2)))[0]
    assert not np.array_equal(seen, later)
    assert not np.array_equal(later[..., 0], later[..., 2])
    assert env.observation_space.contains(later)
