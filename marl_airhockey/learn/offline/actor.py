"""Actor: the policy that all offline algorithms learn, and what they must provide."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import torch
from torch import Tensor

from marl_airhockey.learn.networks import HALF_LOG_TAU, GaussianActor
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.offline.dataset import StepBatch


class Algorithm(GaussianActor, ABC):
    """Algorithm with an actor, whose mean action is the policy.

    Args:
        config: Configuration of the run.
        centre: Centre of the observation, (D,).
        unit: Typical size of its difference from the centre, (D,).
    """

    def __init__(self, config: OfflineConfig, centre: Any, unit: Any) -> None:
        super().__init__(config.hidden, 0.0, centre, unit)
        self.config = config

    def log_density(self, mean: Tensor, action: Tensor) -> Tensor:
        """Return the log density (n,) of actions; log deviations are clipped.

        Log standard deviations are clipped to -5 .. 2.
        """
        log_std = self.log_std.clamp(-5.0, 2.0)
        gap = (action - mean) * torch.exp(-log_std)
        density: Tensor = (-0.5 * gap * gap - log_std - HALF_LOG_TAU).sum(-1)
        return density

    @abstractmethod
    def losses(self, step: int, batch: StepBatch) -> dict[str, Tensor]:
        """Return the losses by name; their sum is minimized.

        Args:
            step: Index of the gradient step, from 0.
            batch: Steps with scaled observations.
        """

    def update_targets(self, step: int) -> None:
        """Update the target networks after a step. By default there are none."""
