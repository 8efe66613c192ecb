"""Advantages of the steps of a rollout."""

from __future__ import annotations

import torch
from torch import Tensor


def generalized_advantage(
    reward: Tensor,
    value: Tensor,
    last_value: Tensor,
    not_done: Tensor,
    gamma: float,
    gae_lambda: float,
) -> Tensor:
    """Return generalized advantage estimates (T, n) (Schulman et al., 2016).

    Args:
        reward: Rewards of the steps, (T, n).
        value: Critic's values of the observations before the steps, (T, n).
        last_value: Critic's values of the observations after the last step, (n,).
        not_done: 0 where an episode ended with the step, else 1, (T, n).
        gamma: Discount factor.
        gae_lambda: Lambda; 0 gives one-step errors, 1 gives whole returns.
    """
    advantage, running = torch.empty_like(value), torch.zeros_like(last_value)
    for t in range(len(value) - 1, -1, -1):
        td_error = reward[t] + gamma * last_value * not_done[t] - value[t]
        running = td_error + gamma * gae_lambda * not_done[t] * running
        advantage[t], last_value = running, value[t]
    return advantage
