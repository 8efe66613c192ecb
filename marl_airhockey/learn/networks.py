"""Networks of the library's own learners: Gaussian actor, critic, pairs of critics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.torch_weights import policy_of_weights

HALF_LOG_TAU = 0.9189385332046727
"""ln(2 pi) / 2, a term of the normal log density."""


def linear_layers(widths: Sequence[int], gain: float) -> nn.Sequential:
    """Return linear layers with ReLUs between them, initialized orthogonally.

    Args:
        widths: Widths of the input and of the layers.
        gain: Gain of the last layer. The other layers have the gain for ReLUs.
    """
    parts: list[nn.Module] = []
    last = len(widths) - 2
    for k, (size, wide) in enumerate(pairwise(widths)):
        layer = nn.Linear(size, wide)
        nn.init.orthogonal_(layer.weight, gain if k == last else 2**0.5)
        nn.init.zeros_(layer.bias)
        parts += [layer, nn.ReLU(inplace=True)]
    return nn.Sequential(*parts[:-1])


@torch.no_grad()
def move_toward(target: nn.Module, source: nn.Module, share: float) -> None:
    """Move the parameters of a target network toward those of its source by a share."""
    pairs = zip(target.parameters(), source.parameters(), strict=True)
    for ours, theirs in pairs:
        ours.lerp_(theirs, share)


class GaussianActor(nn.Module):
    """Actor with normally distributed actions and a fixed scaling of its input.

    Args:
        hidden: Widths of the hidden layers.
        log_std: Initial log standard deviation of the actions.
        centre: Centre of the observation, (D,).
        unit: Typical size of its difference from the centre, (D,).
    """

    def __init__(
        self, hidden: Sequence[int], log_std: float, centre: Any, unit: Any
    ) -> None:
        super().__init__()
        self.centre: Tensor
        self.unit: Tensor
        self.register_buffer("centre", torch.as_tensor(centre))
        self.register_buffer("unit", torch.as_tensor(unit))
        self.actor = linear_layers([len(centre), *hidden, 2], 0.01)
        self.log_std = nn.Parameter(torch.full((2,), log_std))

    def scaled(self, observation: Tensor) -> Tensor:
        """Return observations (n, D) in the scale of the layers' input."""
        return (observation - self.centre) / self.unit

    def log_density(self, mean: Tensor, action: Tensor) -> Tensor:
        """Return the log density (n,) of actions (n, 2) with given means (n, 2)."""
        gap = (action - mean) * torch.exp(-self.log_std)
        return (-0.5 * gap * gap - self.log_std - HALF_LOG_TAU).sum(-1)

    def to_numpy(self, card: Mapping[str, Any]) -> NumpyPolicy:
        """Return the actor as a NumPy policy with a card."""
        linear = [
            f"actor.{name}"
            for name, layer in self.actor.named_children()
            if isinstance(layer, nn.Linear)
        ]
        scale = self.centre, self.unit
        return policy_of_weights(self.state_dict(), linear, scale, self.log_std, card)


class ActorCritic(GaussianActor):
    """Actor and critic that share no layer; `GaussianActor` explains the arguments."""

    def __init__(
        self, hidden: Sequence[int], log_std: float, centre: Any, unit: Any
    ) -> None:
        super().__init__(hidden, log_std, centre, unit)
        self.critic = linear_layers([len(centre), *hidden, 1], 1.0)


class TwinLayers(nn.Module):
    """Two networks of the same widths, computed in one call.

    Args:
        widths: Widths of the input and of the hidden layers, followed by 1.
        normalized: True to normalize the output of each hidden layer over its units,
            without learned factors (Ba, Kiros and Hinton, 2016).
    """

    def __init__(self, widths: Sequence[int], normalized: bool = False) -> None:
        super().__init__()
        self._normalized = normalized
        pair = [linear_layers(widths, 1.0) for _ in range(2)]
        stacked = [
            [layer for layer in one if isinstance(layer, nn.Linear)] for one in pair
        ]
        self.weights = nn.ParameterList(
            torch.stack([a.weight.T, b.weight.T]) for a, b in zip(*stacked, strict=True)
        )
        self.biases = nn.ParameterList(
            torch.stack([a.bias, b.bias])[:, None]
            for a, b in zip(*stacked, strict=True)
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return the values (2, n) of inputs (n, D)."""
        x = x.expand(2, *x.shape)
        last = len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.baddbmm(bias, x, weight)
            if k < last:
                x = torch.relu(x)
                if self._normalized:
                    x = nn.functional.layer_norm(x, x.shape[-1:])
        return x[..., 0]
