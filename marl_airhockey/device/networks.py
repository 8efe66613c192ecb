"""Drivers of worlds on a device: policies as networks of torch."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import Policy
from marl_airhockey.sim.contracts.driver import Driver


class DeviceNetwork:
    """Mean actions of a policy, computed on a torch device.

    The order of its sums differs from that of the CPU. Actions therefore differ by
    rounding.

    Args:
        policy: Policy that the network computes.
        device: Torch device.
    """

    def __init__(self, policy: NumpyPolicy, device: torch.device) -> None:
        self._layers = [
            tuple(torch.from_numpy(array.copy()).to(device) for array in layer)
            for layer in policy.layers
        ]
        self._centre, self._unit = (
            torch.from_numpy(array.copy()).to(device)
            for array in (policy.centre, policy.unit)
        )
        self._bounded = bool(policy.card.get("bounded"))

    def __call__(self, observation: Tensor) -> Tensor:
        """Return actions (B, 2), -1 to 1, for observations (B, D)."""
        x = (observation - self._centre) / self._unit
        for weight, bias in self._layers[:-1]:
            x = nn.functional.linear(x, weight, bias).relu_()
        x = nn.functional.linear(x, *self._layers[-1])
        return torch.tanh(x) if self._bounded else x.clamp(-1.0, 1.0)


def network_of(agent: str, driver: Driver, width: int) -> NumpyPolicy:
    """Return the network of a driver.

    Args:
        agent: Agent at the driver's seat.
        driver: Driver at the seat.
        width: Number of elements of an observation, D.

    Raises:
        ValueError: The driver is not a network for these observations.
    """
    reason = "it is not a policy of the zoo or of a training"
    if isinstance(driver, Policy) and isinstance(driver.predict, NumpyPolicy):
        if driver.observe not in ("velocity", None):
            reason = f"it observes {driver.observe!r}"
        elif driver.shape != (width,):
            reason = f"it expects observations of shape {driver.shape}, not ({width},)"
        elif not driver.deterministic:
            reason = "it samples its actions"
        else:
            return driver.predict
    raise ValueError(
        f"drivers: {agent}: worlds on a device cannot compute this driver: {reason}"
    )
