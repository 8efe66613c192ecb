"""Actor: the policy that all offline algorithms learn, and what they owe."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import torch
from torch import Tensor, nn

from marl_airhockey.learn.layers import linear_layers
from marl_airhockey.learn.offline.config import OfflineConfig

HALF_LOG_TAU = 0.9189385332046727
"""ln(2 pi) / 2, of the normal density"""


class Algorithm(nn.Module, ABC):
    """Algorithm with an actor, whose mean action is the policy.

    Args:
        config: widths of the layers.
        centre: (D,) of the observation.
        unit: (D,) of the observation.
    """

    def __init__(self, config: OfflineConfig, centre: Any, unit: Any) -> None:
        super().__init__()
        self.config = config
        self.centre: Tensor
        self.unit: Tensor
        self.register_buffer("centre", torch.as_tensor(centre))
        self.register_buffer("unit", torch.as_tensor(unit))
        self.actor = linear_layers([len(centre), *config.hidden, 2], 0.01)
        self.log_std = nn.Parameter(torch.zeros(2))

    def scaled(self, observation: Tensor) -> Tensor:
        """Return observations (n, D) as the layers take them."""
        return (observation - self.centre) / self.unit

    def log_density(self, observation: Tensor, action: Tensor) -> Tensor:
        """Return the log density (n,) of actions in scaled observations."""
        log_std = self.log_std.clamp(-5.0, 2.0)
        gap = (action - self.actor(observation)) * torch.exp(-log_std)
        density: Tensor = (-0.5 * gap * gap - log_std - HALF_LOG_TAU).sum(-1)
        return density

    @abstractmethod
    def losses(self, step: int, *batch: Tensor) -> dict[str, Tensor]:
        """Return the losses, whose sum is descended on, by name.

        Args:
            step: number of the step, from 0.
            *batch: observation (n, D) and next observation scaled, action (n, 2),
                reward (n,) and going (n,), see `Dataset`, in the order of its `draw`.
        """

    def follow(self) -> None:
        """Let targets follow, after a step; an algorithm without them has none."""
