"""Pool of past policies of a run, as one driver with one batched product."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from marl_airhockey.learn.device import moved
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.types import Array

MEMBER = "member"
"""Memory with the number of the snapshot in each world."""


class SnapshotPool(Driver):
    """Snapshots of one learner as a driver; worlds play against different ones.

    The weights of all snapshots are stacked, so that one call computes their actions.
    Actions are samples. Who begins an episode writes the number of its snapshot to the
    memory `MEMBER`.

    Args:
        device: Device that computes the actions.
    """

    def __init__(self, device: torch.device) -> None:
        self._device = device
        self._numbers: list[list[Tensor]] = []
        """Weights (in, out) and biases (1, out) of each snapshot in turn."""
        self._stacks: list[Tensor] = []
        self._deviations = np.zeros((0, 2))

    def __len__(self) -> int:
        return len(self._numbers)

    def put(self, member: int, policy: NumpyPolicy) -> None:
        """Add a snapshot, or replace the one with the same number."""
        # The scaling of the input is part of the first layer.
        (first, bias), *rest = policy.layers
        scaled = first / policy.unit
        layers = [(scaled, bias - scaled @ policy.centre), *rest]
        numbers = [
            torch.tensor(part, dtype=torch.float32, device=self._device)
            for weight, bias in layers
            for part in (weight.T, bias[None])
        ]
        self._numbers[member : member + 1] = [numbers]
        self._stacks = [
            torch.stack(parts) for parts in zip(*self._numbers, strict=True)
        ]
        kept = [*self._deviations]
        kept[member : member + 1] = [np.exp(policy.log_std)]
        self._deviations = np.array(kept, np.float64)
        self.observe = policy.card.get("observe")

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        return {MEMBER: np.zeros(worlds, np.int64)}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        member = memory[MEMBER]
        action = self._means(np.asarray(view.observation, np.float32), member)
        action += self._deviations[member] * view.rng.normal(2)
        return np.clip(action, -1.0, 1.0), memory

    def _means(self, observation: Array, member: Array) -> Array:
        """Return the mean actions (n, 2) of the snapshots with some numbers (n,)."""
        counts = np.bincount(member, minlength=len(self))
        order = np.argsort(member, kind="stable")
        place = np.arange(len(member)) - np.repeat(counts.cumsum() - counts, counts)
        rows = member[order], place
        shape = len(self), int(counts.max()), observation.shape[1]
        padded = np.zeros(shape, np.float32)
        padded[rows] = observation[order]
        with torch.inference_mode():
            x = moved(padded, self._device)
            pairs = zip(self._stacks[::2], self._stacks[1::2], strict=True)
            for k, (weight, bias) in enumerate(pairs):
                x = torch.baddbmm(bias, x.relu() if k else x, weight)
            found = x.cpu().numpy()
        means = np.empty((len(member), 2))
        means[order] = found[rows]
        return means
