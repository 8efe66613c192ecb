"""Players that see and act as in a mirror."""

from dataclasses import replace

import numpy as np
import pytest

from marl_airhockey.learn.mirror import Mirror
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.self_play import make_training_env


def training_env(game, folder, **changes):
    config = preset(game, {"num_worlds": 8, "batch_size": 64, "seed": 3, **changes})
    return make_training_env(config, 8, folder)


def mirrored(state):
    """Return the mirror image of a state."""
    flip = np.array([1.0, -1.0])
    return replace(
        state,
        position=state.position * flip,
        velocity=state.velocity * flip,
        angle=-state.angle,
        spin=-state.spin,
    )


def test_the_mirror_image_of_a_game_is_the_same_game(tmp_path):
    one = training_env("rally", tmp_path)
    two = training_env("rally", tmp_path, mirrored_share=1.0)
    one.seed(1)
    two.seed(1)
    one.reset()
    two.reset()
    state, memory = one.world.get_state()
    seen = one.set_state(state, memory)
    np.testing.assert_allclose(two.set_state(mirrored(state), memory), seen, atol=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(25):
        action = rng.uniform(-1, 1, (one.num_envs, 2))
        seen, reward, done, _ = one.step(action)
        other = two.step(action)
        if done.any():
            break
        np.testing.assert_allclose(other[0], seen, atol=2e-4)
        np.testing.assert_allclose(other[1], reward, atol=1e-6)
    assert one.world.state.time[0] > 0.5


def test_half_of_the_players_are_mirrored_and_that_changes():
    mirror = Mirror(["own.x", "own.y", "puck_0.spin", "held_0"], 0.5, 0)
    mirror.begin(np.arange(1000), 1000)
    seen = mirror.observations(np.ones((1000, 4)))
    assert (seen[:, [0, 3]] == 1.0).all()
    np.testing.assert_array_equal(seen[:, 1], seen[:, 2])
    assert 400 < (seen[:, 1] == -1.0).sum() < 600
    acted = mirror.actions(np.ones((1000, 2)))
    np.testing.assert_array_equal(acted, seen[:, :2])
    mirror.begin(np.arange(500), 1000)
    again = mirror.observations(np.ones((1000, 4)))
    assert (again[:500] != seen[:500]).any()
    np.testing.assert_array_equal(again[500:], seen[500:])


def test_images_are_refused():
    with pytest.raises(ValueError, match="mirrored_share"):
        Mirror((), 0.5, 0)
