"""Learned policy as NumPy arrays, in one small file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.policies.numpy_network import NumpyNetwork
from marl_airhockey.sim.jit.elementary import expm1
from marl_airhockey.types import Array


@dataclass(frozen=True, repr=False)
class NumpyPolicy(NumpyNetwork):
    """Network with ReLU layers that returns the mean action.

    `NumpyNetwork` explains the other arguments. With the entry "bounded" in the card,
    tanh is applied to the output of the last layer.

    Args:
        log_std: Logarithm of the standard deviation (2,) of the action noise in
            training.
    """

    kind: ClassVar[str] = "policy"

    log_std: Array

    def __call__(
        self, observation: Array | Mapping[str, Array], deterministic: bool = True
    ) -> Array:
        """Return mean actions (B, 2) for observations (B, D); the driver adds noise.

        In a dictionary, the achieved and the desired goal follow the observation.
        """
        if isinstance(observation, Mapping):
            parts = ("observation", "achieved_goal", "desired_goal")
            observation = np.concatenate([observation[part] for part in parts], -1)
        action = self.forward(observation)
        if not self.card.get("bounded"):
            return action
        # The hyperbolic tangent; NumPy's depends on the processor.
        t = expm1(2.0 * np.clip(action, -20.0, 20.0))
        return np.asarray(t / (t + 2.0), action.dtype)

    def _check(self) -> None:
        super()._check()
        if len(self.layers[-1][1]) != 2 or self.log_std.shape != (2,):
            raise ValueError("its actions do not have the shape (2,)")
        if not isinstance(self.card.get("observe"), (str, type(None))):
            raise ValueError("`observe` is not a text")
