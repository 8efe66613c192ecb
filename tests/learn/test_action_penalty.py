"""Penalty on rough actions, and what it is taken off."""

import numpy as np
from runs import SMALL

from marl_airhockey.learn.action_penalty import ActionPenalty
from marl_airhockey.learn.ppo_config import preset
from marl_airhockey.learn.self_play import make_training_env


def test_penalty_of_a_jump_follows_its_formula_and_ends_with_the_episode():
    penalty = ActionPenalty(rate=1.0, jerk=0.5, cost=2.0)
    action, excess = np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([0.0, 0.25])
    first = penalty(action, excess, np.array([False, False]))
    np.testing.assert_allclose(first, [1.0 + 0.5, 2.0 * 0.25])
    # The same action again: no change, but the change changed by one.
    again = penalty(action, excess, np.array([True, False]))
    np.testing.assert_allclose(again, [0.5, 0.5])
    # After an episode there was no action before.
    fresh = penalty(action, excess, np.array([False, False]))
    np.testing.assert_allclose(fresh, [1.5, 0.5])


def test_training_rewards_are_lower_by_the_penalty(tmp_path):
    plain = make_training_env(preset("touch", SMALL), 8, tmp_path)
    weights = {"action_rate_weight": 0.1, "action_jerk_weight": 0.2, "cost_weight": 0.3}
    shaped = make_training_env(preset("touch", {**SMALL, **weights}), 8, tmp_path)
    rng = np.random.default_rng(0)
    for env in (plain, shaped):
        env.seed(3)
        env.reset()
    last, before = np.zeros((2, 8, 2))
    for _ in range(5):
        actions = 0.1 * rng.uniform(-1.0, 1.0, (8, 2))  # Within all limits.
        reward, lower = plain.step(actions)[1], shaped.step(actions)[1]
        change, bend = actions - last, actions - 2.0 * last + before
        expected = 0.1 * (change**2).sum(-1) + 0.2 * (bend**2).sum(-1)
        np.testing.assert_allclose(reward - lower, expected, atol=1e-6)
        last, before = actions, last
    assert "action_penalty" in shaped.last_terms
    assert "action_penalty" not in plain.last_terms
    corner = np.ones((8, 2))  # Beyond top speed.
    assert (plain.step(corner)[1] - shaped.step(corner)[1] > 0.3).all()
