"""Worlds that are played at random."""

import numpy as np


def rollout(world, steps, seed, policy_seed=0):
    """Observations, rewards and dones of random actions, stacked."""
    rng = np.random.default_rng(policy_seed)
    seen = [world.reset(seed)]
    rewards, dones = [], []
    shape = (world.num_worlds, len(world.open), 2)
    for _ in range(steps):
        step = world.step(rng.uniform(-1, 1, shape))
        seen.append(step.observation)
        rewards.append(step.reward)
        dones.append(step.terminated | step.truncated)
    return np.array(seen), np.array(rewards), np.array(dones)
