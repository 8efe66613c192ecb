"""Replay buffer of hindsight goals whose terminations fit the new goals."""

from __future__ import annotations

from typing import Any

from stable_baselines3 import HerReplayBuffer
from stable_baselines3.common.type_aliases import DictReplayBufferSamples


class GoalEndsReplayBuffer(HerReplayBuffer):
    """Buffer for tasks that end with a reward of 1 when their goal is met.

    In the buffer of stable-baselines3 a relabelled step keeps the recorded termination,
    which belongs to the former goal. Steps that meet the new goal would be
    bootstrapped, and steps that met the former goal would not. In this buffer a
    relabelled step is terminated if, and only if, it meets its new goal.
    """

    def _get_virtual_samples(self, *args: Any) -> DictReplayBufferSamples:
        samples = super()._get_virtual_samples(*args)
        return samples._replace(dones=(samples.rewards > 0.0).float())
