"""The fixed input scaling of policies: no running statistics, nothing to lose."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor


class FixedScale(BaseFeaturesExtractor):
    """``(observation - centre) / unit`` with the typical sizes of the views.

    Args:
        observation_space: Box (D,), or the Dict of goals="dict".
        centre: (D,) of the flat observation.
        unit: (D,) of the flat observation.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        centre: list[float],
        unit: list[float],
    ) -> None:
        size = spaces.flatdim(observation_space)
        super().__init__(observation_space, size)
        self.centre: torch.Tensor
        self.rate: torch.Tensor
        self.register_buffer("centre", torch.tensor(centre))
        self.register_buffer("rate", 1.0 / torch.tensor(unit))

    def forward(
        self, observations: torch.Tensor | dict[str, torch.Tensor]
    ) -> torch.Tensor:
        """(B, size): the flat part scaled, goals behind it as they are."""
        if isinstance(observations, torch.Tensor):
            return (observations - self.centre) * self.rate
        flat = (observations["observation"] - self.centre) * self.rate
        goals = [observations["achieved_goal"], observations["desired_goal"]]
        return torch.cat([flat, *goals], dim=-1)
