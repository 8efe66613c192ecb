"""Input layer of the networks of stable-baselines3.

Saved models refer to the class by the name of this module.
"""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor


class FixedScale(BaseFeaturesExtractor):
    """Input layer ``(observation - centre) / unit`` with fixed centre and unit.

    Args:
        observation_space: Box (D,), or the Dict of goals="dict".
        centre: Centre of the flat observation, (D,).
        unit: Typical size of its difference from the centre, (D,).
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
        """Return the scaled flat part, followed by the unscaled goals, (B, size)."""
        if isinstance(observations, torch.Tensor):
            return (observations - self.centre) * self.rate
        flat = (observations["observation"] - self.centre) * self.rate
        goals = [observations["achieved_goal"], observations["desired_goal"]]
        return torch.cat([flat, *goals], dim=-1)
