"""Input layers of the networks of stable-baselines3.

Saved models refer to the classes by the name of this module.
"""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from marl_airhockey.learn.image_networks import darkness, small_layers


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


class ImageFeatures(BaseFeaturesExtractor):
    """Convolutional layers of the small network.

    Args:
        observation_space: Box (channels, H, W) of images.
    """

    def __init__(self, observation_space: spaces.Box) -> None:
        layers = small_layers(observation_space.shape[0])
        with torch.no_grad():
            size = layers(torch.zeros(1, *observation_space.shape)).shape[1]
        super().__init__(observation_space, size)
        self.layers = layers

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features (B, size) of images (B, channels, H, W), 0 to 1."""
        found: torch.Tensor = self.layers(darkness(observations))
        return found
