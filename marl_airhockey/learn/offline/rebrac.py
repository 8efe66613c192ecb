"""ReBRAC (Tarasov et al., 2023): TD3+BC with an additional penalty in the critics.

The loss of the actor and the target of the critics have separate weights for the
distance from the actions of the data. The critics have layer normalization. The larger
batches and the third layer of the paper are not used, so that all algorithms have the
same networks.
"""

from __future__ import annotations

from torch import Tensor

from marl_airhockey.learn.offline.dataset import StepBatch
from marl_airhockey.learn.offline.td3_bc import TD3BC


class ReBRAC(TD3BC):
    """ReBRAC with the settings `actor_penalty` and `critic_penalty`."""

    NORMALIZED = True

    def target_penalty(self, action: Tensor, batch: StepBatch) -> Tensor:
        distance = (action - batch.next_action).square().sum(-1)
        return self.config.critic_penalty * distance

    def actor_loss(self, batch: StepBatch) -> Tensor:
        value, error = self.value_and_error(batch)
        scale = 1.0 / value.abs().mean().detach()
        # The error is a mean over the two elements of an action; 2 makes it a sum.
        return 2.0 * self.config.actor_penalty * error - scale * value.mean()


make = ReBRAC
