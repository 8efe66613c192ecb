"""Behaviour cloning: the mean squared error of actions (Pomerleau, 1989)."""

from __future__ import annotations

import torch
from torch import Tensor

from marl_airhockey.learn.offline.actor import Algorithm
from marl_airhockey.learn.offline.dataset import StepBatch


class BehaviourCloning(Algorithm):
    """Behaviour cloning; with ``share`` below 1 only the best episodes are cloned."""

    def losses(self, step: int, batch: StepBatch) -> dict[str, Tensor]:
        error = (self.actor(batch.observation) - batch.action).square()
        # The deviation is fitted to the errors and does not affect the actor.
        spread = torch.exp(2 * self.log_std)
        deviation = (error.detach().mean(0) / spread / 2 + self.log_std).sum()
        return {"actor": error.sum(-1).mean(), "deviation": deviation}


make = BehaviourCloning
