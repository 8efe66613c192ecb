"""Learned policy as a driver, and the environment of its training."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.contracts.image_form import PIXELS
from marl_airhockey.types import Array

Predict = Callable[[Any, bool], Array]
"""Function (observations (B, ...), deterministic) -> actions (B, 2)."""


@dataclass
class Policy(Driver):
    """Learned policy as a driver.

    Call ``predict`` to use the policy outside of environments. Its arguments are
    observations (B, D) of the training environment, and True for mean actions. It
    returns actions (B, 2), fraction of top speed, ego frame. They can be slightly
    outside -1 to 1, where environments clip them.

    Args:
        predict: Function (observations (B, ...), deterministic) -> actions (B, 2).
        shape: Shape of an observation, or of its images, in training; None if
            unknown.
        observe: Observation type in training; None for the type of the environment.
        source: Origin of the policy, for messages.
        deterministic: True to act with mean actions, False to act with samples.
    """

    predict: Predict
    shape: tuple[int, ...] | None = None
    observe: str | None = None
    source: str = "policy"
    deterministic: bool = True
    noise: Array | None = None
    """Standard deviation of sampled actions (2,), if `predict` returns only means."""
    can_sample: bool = True
    """False if it returns only mean actions, as ONNX models do."""
    trained_in: Mapping[str, Any] = field(default_factory=dict)

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        action = self._actions(view.observation)
        if self.noise is not None and not self.deterministic:
            action += self.noise * view.rng.normal(2)
        if not np.isfinite(action).all():
            raise ValueError(f"{self.source}: an action is nan or inf")
        return np.clip(action, -1.0, 1.0), memory

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        if isinstance(observation, Mapping) and PIXELS in observation:
            shape: tuple[int, ...] = observation[PIXELS].shape[1:]
        elif isinstance(observation, Mapping):
            shape = (sum(x.shape[1] for x in observation.values()),)
        else:
            shape = observation.shape[1:]
        if self.shape not in (None, shape):
            scenario = self.trained_in.get("scenario")
            where = f"it was trained on {scenario}; " if scenario else ""
            raise ValueError(
                f"{self.source}: it expects observations of shape {self.shape}, this "
                f"environment returns {shape}; {where}check the scenario and its "
                "options (observe, goals, reaction, seats)"
            )

    def _actions(self, observation: Any) -> Array:
        return np.asarray(self.predict(observation, self.deterministic), np.float64)


TRAINED_IN: dict[str, type | tuple[type, ...]] = {
    "scenario": str,
    "profile": str,
    "options": dict,
    "physics": dict,
    "drivers": dict,
    "control_dt": (int, float),
    "goals": str,
}
"""Entries that describe the environment of a training, and their types."""


def trained_in(card: Mapping[str, Any]) -> dict[str, Any]:
    """Return the training environment from a policy's card or a run's settings.

    Returns:
        Name of the scenario, and keywords of the environment. Entries of another type
        are left out, because a file can contain anything.
    """
    return {
        name: card[name]
        for name, kind in TRAINED_IN.items()
        if isinstance(card.get(name), kind)
    }


def policy_driver(
    policy: NumpyPolicy, source: str, deterministic: bool = True
) -> Policy:
    """Return a NumPy policy as a driver."""
    return Policy(
        policy,
        policy.centre.shape,
        policy.card.get("observe"),
        source,
        deterministic,
        np.exp(policy.log_std),
        trained_in=trained_in(policy.card),
    )
