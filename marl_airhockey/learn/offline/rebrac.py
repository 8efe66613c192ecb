"""ReBRAC (Tarasov et al., 2023): TD3+BC with a penalty in the critics' target, too.

Actor and critics have weights of their own for the distance from the actions of the
data, and the critics layer normalization. Its larger batches and third layer are not
taken over, so that all algorithms here have the same networks.
"""

from __future__ import annotations

from torch import Tensor

from marl_airhockey.learn.offline.dataset import StepBatch
from marl_airhockey.learn.offline.td3_bc import TD3BC


class ReBRAC(TD3BC):
    """ReBRAC; settings are `actor_penalty` and `critic_penalty`."""

    NORMALIZED = True

    def target_penalty(self, action: Tensor, batch: StepBatch) -> Tensor:
        distance = (action - batch.next_action).square().sum(-1)
        return self.config.critic_penalty * distance

    def actor_loss(self, batch: StepBatch) -> Tensor:
        value, error = self.value_and_error(batch)
        scale = 1.0 / value.abs().mean().detach()
        # The mean over both numbers of an action, as a sum.
        return 2.0 * self.config.actor_penalty * error - scale * value.mean()


make = ReBRAC
