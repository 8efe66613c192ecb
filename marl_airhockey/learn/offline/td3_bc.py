"""TD3+BC (Fujimoto and Gu, 2021): a deterministic actor that stays close to the data.

The actor maximizes the value of its actions, divided by the mean magnitude of this
value. The squared distance from the actions of the data is a penalty.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import torch
from torch import Tensor
from torch.func import functional_call

from marl_airhockey.learn.networks import TwinLayers, move_toward
from marl_airhockey.learn.offline.actor import Algorithm
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.offline.dataset import StepBatch
from marl_airhockey.policies.numpy_policy import NumpyPolicy


class TD3BC(Algorithm):
    """TD3+BC with two critics and one actor step per `policy_delay` critic steps."""

    NORMALIZED = False
    """True if the critics have layer normalization."""

    def __init__(self, config: OfflineConfig, centre: Any, unit: Any) -> None:
        super().__init__(config, centre, unit)
        # It is not learned; it is only the noise of sampled actions.
        self.log_std.requires_grad_(False).fill_(-2.3)
        sizes = [len(centre) + 2, *config.hidden, 1]
        self.critics = TwinLayers(sizes, self.NORMALIZED)
        self.critic_targets = deepcopy(self.critics).requires_grad_(False)
        self.actor_target = deepcopy(self.actor).requires_grad_(False)

    def losses(self, step: int, batch: StepBatch) -> dict[str, Tensor]:
        target = self.critic_target(batch)
        values = self.critics(torch.cat([batch.observation, batch.action], -1))
        losses = {"critic": (values - target).square().mean(-1).sum()}
        if step % self.config.policy_delay == 0:
            losses["actor"] = self.actor_loss(batch)
        return losses

    @torch.no_grad()
    def critic_target(self, batch: StepBatch) -> Tensor:
        """Return the target values (n,) of the critics."""
        after, config = batch.next_observation, self.config
        action = torch.tanh(self.actor_target(after))
        noise = config.target_noise * torch.randn_like(action)
        noise.clamp_(-config.noise_clip, config.noise_clip)
        action = (action + noise).clamp(-1.0, 1.0)
        value = self.critic_targets(torch.cat([after, action], -1)).amin(0)
        value = value - self.target_penalty(action, batch)
        found: Tensor = batch.reward + config.gamma * batch.not_done * value
        return found

    def target_penalty(self, action: Tensor, batch: StepBatch) -> Tensor | float:
        """Return the penalty of the values of target actions, (n,)."""
        return 0.0

    def actor_loss(self, batch: StepBatch) -> Tensor:
        """Return the loss of the actor."""
        value, error = self.value_and_error(batch)
        scale = self.config.alpha / value.abs().mean().detach()
        return error - scale * value.mean()

    def value_and_error(self, batch: StepBatch) -> tuple[Tensor, Tensor]:
        """Return values (n,) of the actor's actions, and their mean squared error."""
        action = torch.tanh(self.actor(batch.observation))
        # The critics are constant here, so that only the actor learns.
        fixed = {name: p.detach() for name, p in self.critics.named_parameters()}
        both = torch.cat([batch.observation, action], -1)
        value: Tensor = functional_call(self.critics, fixed, (both,))[0]
        return value, (action - batch.action).square().mean()

    def update_targets(self, step: int) -> None:
        if step % self.config.policy_delay == 0:
            move_toward(self.critic_targets, self.critics, self.config.tau)
            move_toward(self.actor_target, self.actor, self.config.tau)

    def to_numpy(self, card: Any) -> NumpyPolicy:
        return super().to_numpy({**card, "bounded": True})


make = TD3BC
