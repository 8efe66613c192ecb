"""Layers of our own learners, and their form as plain arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from marl_airhockey.policies.numpy_policy import NumpyPolicy


def linear_layers(widths: Sequence[int], gain: float) -> nn.Sequential:
    """Return linear layers with rectifiers between them, orthogonal at first.

    Args:
        widths: of the input and of the layers.
        gain: of the last layer; that of the others suits rectifiers.
    """
    parts: list[nn.Module] = []
    last = len(widths) - 2
    for k, (size, wide) in enumerate(pairwise(widths)):
        layer = nn.Linear(size, wide)
        nn.init.orthogonal_(layer.weight, gain if k == last else 2**0.5)
        nn.init.zeros_(layer.bias)
        parts += [layer, nn.ReLU(inplace=True)]
    return nn.Sequential(*parts[:-1])


def plain_policy(
    layers: nn.Sequential,
    centre: Tensor,
    unit: Tensor,
    log_std: Tensor,
    card: Mapping[str, Any],
) -> NumpyPolicy:
    """Return layers from observations to mean actions as plain arrays.

    Args:
        layers: of `linear_layers`.
        centre: (D,) subtracted from observations.
        unit: (D,) divisor of the difference.
        log_std: (2,) of the actions.
        card: of the policy.
    """
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    arrays = [(_array(x.weight), _array(x.bias)) for x in linear]
    return NumpyPolicy(arrays, _array(centre), _array(unit), _array(log_std), card)


def _array(tensor: Tensor) -> Any:
    return tensor.detach().numpy().astype(np.float32).copy()


class TwinLayers(nn.Module):
    """Two networks of the same widths, computed at once.

    Args:
        widths: of the input, of the hidden layers, and 1.
    """

    def __init__(self, widths: Sequence[int]) -> None:
        super().__init__()
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
        """Return (2, n) values of inputs (n, D)."""
        x = x.expand(2, *x.shape)
        last = len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.baddbmm(bias, x, weight)
            if k < last:
                x = torch.relu(x)
        return x[..., 0]
