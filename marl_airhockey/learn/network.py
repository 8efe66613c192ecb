"""Networks of policies: fixed scaling of inputs, conversion to plain arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import trained_in
from marl_airhockey.policies.runs import RUN_FORMAT
from marl_airhockey.policies.sb3 import numpy_actor, scaled_policy


class FixedScale(BaseFeaturesExtractor):
    """Input layer ``(observation - centre) / unit``, by the observables' typical sizes.

    Args:
        observation_space: Box (D,), or the Dict of goals="dict".
        centre: (D,) of the flat observation.
        unit: (D,) of the flat observation.
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
        """Return (B, size): the flat part scaled, then goals as they are."""
        if isinstance(observations, torch.Tensor):
            return (observations - self.centre) * self.rate
        flat = (observations["observation"] - self.centre) * self.rate
        goals = [observations["achieved_goal"], observations["desired_goal"]]
        return torch.cat([flat, *goals], dim=-1)


def policy_card(config: RunConfig, labels: Sequence[str]) -> dict[str, Any]:
    """Return what a policy must be given to see; saved together with it.

    Args:
        config: of its run.
        labels: names of the elements of its observations.
    """
    return {
        "run_format": RUN_FORMAT,
        **trained_in(vars(config)),
        "observe": config.observe,
        "labels": list(labels),
    }


def to_numpy(model: PPO, card: Mapping[str, Any]) -> NumpyPolicy:
    """Return the actor of a model of `sb3.build_model` as plain arrays.

    Raises:
        ValueError: another kind of model: pixels, other layers.
    """
    return numpy_actor(model.policy.state_dict(), card)


def layers_to_numpy(
    layers: Iterable[torch.nn.Module],
    scale: FixedScale,
    log_std: torch.Tensor,
    card: Mapping[str, Any],
) -> NumpyPolicy:
    """Return linear layers, with rectifiers between them, as plain arrays."""

    def array(tensor: torch.Tensor) -> Any:
        return tensor.detach().cpu().numpy().astype(np.float32).copy()

    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    return scaled_policy(
        [(array(x.weight), array(x.bias)) for x in linear],
        array(scale.centre),
        array(1.0 / scale.rate),
        array(log_std),
        card,
    )
