"""NumPy policies from weights of torch, without an import of torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from marl_airhockey.policies.numpy_policy import NumpyPolicy


def policy_of_weights(
    weights: Mapping[str, Any],
    layers: Sequence[str],
    scale: tuple[Any, Any],
    log_std: Any,
    card: Mapping[str, Any],
) -> NumpyPolicy:
    """Return linear layers, with ReLU between them, as a NumPy policy.

    Args:
        weights: Tensors by name, as in a ``state_dict``.
        layers: Names of the layers, whose tensors are ``NAME.weight`` and
            ``NAME.bias``.
        scale: Centre and unit (D,) of the flat observation, tensors. Goals that follow
            the observation are not scaled.
        log_std: Logarithm of the standard deviation (2,) of the actions, a tensor.
        card: Card of the policy, see `NumpyPolicy`.

    Raises:
        KeyError: A layer does not exist.
    """
    pairs = [
        (_array(weights[f"{name}.weight"]), _array(weights[f"{name}.bias"]))
        for name in layers
    ]
    centre, unit = map(_array, scale)
    goals = (0, pairs[0][0].shape[1] - len(centre))
    unit = np.pad(unit, goals, constant_values=1.0)
    centre, log_std = np.pad(centre, goals), _array(log_std)
    return NumpyPolicy(pairs, centre, unit, log_std, card=card)


def _array(tensor: Any) -> Any:
    return np.array(tensor.detach().cpu().numpy(), np.float32)
