"""One product for all snapshots of a pool."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import torch

from marl_airhockey.learn.snapshot_pool import MEMBER, SnapshotPool
from marl_airhockey.policies.numpy_policy import NumpyPolicy


def network(rng, log_std=-30.0):
    """A policy of random numbers, by default without noise."""
    sizes = (5, 8, 8, 2)
    layers = [
        (0.5 * rng.normal(size=(b, a)), rng.normal(size=b)) for a, b in pairwise(sizes)
    ]
    scale = rng.normal(size=5), rng.uniform(0.5, 2.0, 5)
    return NumpyPolicy(layers, *scale, np.full(2, log_std))


def actions(pool, observation, member):
    rng = SimpleNamespace(normal=lambda n: np.ones((len(member), n)))
    view = SimpleNamespace(observation=observation, rng=rng)
    return pool.act(view, {MEMBER: np.array(member)})[0]


def test_each_row_gets_the_action_of_its_snapshot():
    rng = np.random.default_rng(0)
    policies = [network(rng) for _ in range(3)]
    pool = SnapshotPool(torch.device("cpu"))
    for number, policy in enumerate(policies):
        pool.put(number, policy)
    assert len(pool) == 3
    observation = rng.normal(size=(7, 5))
    for member in ([2, 0, 2, 2, 0, 0, 2], [1] * 7):
        wanted = [
            policies[m](row[None])[0]
            for m, row in zip(member, observation, strict=True)
        ]
        found = actions(pool, observation, member)
        np.testing.assert_allclose(found, np.clip(wanted, -1, 1), atol=1e-5)


def test_a_replaced_snapshot_is_another_one_and_noise_is_its_own():
    rng = np.random.default_rng(1)
    pool = SnapshotPool(torch.device("cpu"))
    pool.put(0, network(rng))
    pool.put(1, network(rng))
    other = network(rng, np.log(0.25))
    pool.put(0, other)
    assert len(pool) == 2
    observation = 0.01 * rng.normal(size=(2, 5))
    first, _ = actions(pool, observation, [0, 1])
    wanted = np.clip(other(observation[:1])[0] + 0.25, -1, 1)
    np.testing.assert_allclose(first, wanted, atol=1e-5)
