"""Implicit Q-learning (Kostrikov, Nair and Levine, 2022).

The value of a state is an expectile of the values of the actions in the data. No other
action is therefore ever evaluated. Better actions are cloned with a larger weight.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import torch
from torch import Tensor

from marl_airhockey.learn.networks import TwinLayers, linear_layers, move_toward
from marl_airhockey.learn.offline.actor import Algorithm
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.offline.dataset import StepBatch

LARGEST_WEIGHT = 100.0
"""Largest weight of an action, as in the paper."""


class ImplicitQLearning(Algorithm):
    """Implicit Q-learning with two critics and their target networks."""

    def __init__(self, config: OfflineConfig, centre: Any, unit: Any) -> None:
        super().__init__(config, centre, unit)
        size = len(centre)
        self.value = linear_layers([size, *config.hidden, 1], 1.0)
        self.critics = TwinLayers([size + 2, *config.hidden, 1])
        self.targets = deepcopy(self.critics).requires_grad_(False)

    def losses(self, step: int, batch: StepBatch) -> dict[str, Tensor]:
        observation, action, reward, after, _, not_done = batch
        both = torch.cat([observation, action], -1)
        with torch.no_grad():
            target = self.targets(both).amin(0)
            ahead = reward + self.config.gamma * not_done * self.value(after)[:, 0]
        value = self.value(observation)[:, 0]
        advantage = target - value
        weight = torch.exp(self.config.temperature * advantage.detach())
        density = self.log_density(self.actor(observation), action)
        side = torch.where(
            advantage > 0, self.config.expectile, 1.0 - self.config.expectile
        )
        return {
            "value": (side * advantage.square()).mean(),
            "critic": (self.critics(both) - ahead).square().mean(-1).sum(),
            "actor": -(weight.clamp(max=LARGEST_WEIGHT) * density).mean(),
        }

    def update_targets(self, step: int) -> None:
        move_toward(self.targets, self.critics, self.config.tau)


make = ImplicitQLearning
