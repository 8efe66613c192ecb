"""The engine "torch": its advantages are those of the definition."""

import numpy as np
import torch

from marl_airhockey.learn.advantages import generalized_advantage


def test_advantages_are_discounted_sums_of_td_errors():
    steps, slots, gamma, lam = 7, 3, 0.97, 0.9
    rng = np.random.default_rng(0)
    reward, value = rng.normal(size=(2, steps, slots))
    last = rng.normal(size=slots)
    not_done = np.ones((steps, slots))
    not_done[3, 0] = not_done[5, 1] = not_done[6, 2] = 0.0
    tensors = (torch.from_numpy(x) for x in (reward, value, last, not_done))
    found = generalized_advantage(*tensors, gamma, lam).numpy()
    after = np.concatenate([value[1:], last[None]])
    error = reward + gamma * not_done * after - value
    for slot in range(slots):
        for first in range(steps):
            total, weight = 0.0, 1.0
            for t in range(first, steps):
                total += weight * error[t, slot]
                weight *= gamma * lam * not_done[t, slot]
            np.testing.assert_allclose(found[first, slot], total, atol=1e-12)
