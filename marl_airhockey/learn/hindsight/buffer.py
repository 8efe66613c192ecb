"""Replay buffer of hindsight goals whose terminations fit the new goals."""

from __future__ import annotations

from typing import Any

from stable_baselines3 import HerReplayBuffer
from stable_baselines3.common.type_aliases import DictReplayBufferSamples


class GoalEndsReplayBuffer(HerReplayBuffer):
    """Buffer for tasks that end when their goal is met, with a reward of 1.

    stable-baselines3 gives a relabelled step the termination that was recorded, which
    is that of the former goal: steps that meet the new goal would be bootstrapped, and
    steps that met the former one would not. Here a relabelled step is terminated if,
    and only if, it meets its new goal.
    """

    def _get_virtual_samples(self, *args: Any) -> DictReplayBufferSamples:
        samples = super()._get_virtual_samples(*args)
        return samples._replace(dones=(samples.rewards > 0.0).float())
