"""Drivers from functions, models with ``predict`` and torch modules."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from marl_airhockey.policies.policy import Policy
from marl_airhockey.policies.sb3 import model_environment
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.types import Array


@dataclass
class OwnPolicy(Policy):
    """Policy of a user, which accepts a batch of observations or a single one.

    `check` determines which. It calls the policy with three observations of zeros and,
    if that fails, with one.
    """

    one_by_one: bool = False
    """True if it accepts one observation at a time."""

    def check(self, observation: Any) -> None:
        shape = _shape(observation)
        many = _ask(self.predict, observation)
        if _are_actions(many, (shape[0], 2)):
            self.one_by_one = False
            return
        one = _ask(self.predict, _row(observation, 0))
        if _are_actions(one, (2,)):
            self.one_by_one = True
            return
        raise ValueError(
            f"{self.source} cannot act in this environment: for observations of shape "
            f"{shape} it returned {_text(many)}, for one of them {_text(one)}; "
            f"expected finite actions of shape ({shape[0]}, 2) or (2,)"
        )

    def _actions(self, observation: Any) -> Array:
        if not self.one_by_one:
            return super()._actions(observation)
        count = _shape(observation)[0]
        rows = [self.predict(_row(observation, k), True) for k in range(count)]
        return np.array(rows, np.float64).reshape(count, 2)


def driver_of(player: object) -> Driver:
    """Create a driver from an object.

    Args:
        player: One of the following.

            - Object or class of a `Driver`.
            - Torch module or function from observations (B, D) to actions (B, 2), or
              from one observation (D,) to one action (2,).
            - Object with ``predict(observation, deterministic=True)``, such as a model
              of stable-baselines3, or with ``predict(observation)``.

    Raises:
        ValueError: The object is none of these.
    """
    if isinstance(player, Driver):
        return player
    if isinstance(player, type) and issubclass(player, Driver):
        return player()
    source = getattr(player, "__name__", type(player).__name__)
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(player, torch.nn.Module):
        return OwnPolicy(_Network(player), source=source)
    if isinstance(player, type):
        raise ValueError(
            f"{source}: the class is not a Driver; give an object of it instead"
        )
    if callable(getattr(player, "predict", None)):
        known = model_environment(player)
        return OwnPolicy(_Model(player), source=source, trained_in=known)
    if callable(player):
        return OwnPolicy(_Function(player), source=source)
    raise ValueError(
        f"{source} {player!r:.60} is not a driver: give the name of a driver, the path "
        "of a policy, a function from observation to action, an object with predict(), "
        "a torch module or a Driver"
    )


@dataclass
class _Function:
    """Prediction by a function of the observation."""

    function: Callable[[Any], Any]

    def __call__(self, observation: Any, deterministic: bool) -> Array:
        return np.asarray(self.function(observation))


@dataclass
class _Model:
    """Prediction by an object with ``predict``."""

    model: Any

    def __call__(self, observation: Any, deterministic: bool) -> Array:
        try:
            said = self.model.predict(observation, deterministic=deterministic)
        except TypeError as error:
            if "deterministic" not in str(error):
                raise
            said = self.model.predict(observation)
        # Stable-baselines3 also returns the state of a recurrent network.
        if isinstance(said, tuple):
            said, state = said
            if state is not None:
                raise ValueError(
                    "a recurrent policy has a state between steps; write a Driver that "
                    "stores it in its memory"
                )
        return np.asarray(said)


@dataclass
class _Network:
    """Prediction by a torch module."""

    module: Any

    def __call__(self, observation: Any, deterministic: bool) -> Array:
        import torch

        with torch.no_grad():
            if isinstance(observation, Mapping):
                given: Any = {k: torch.as_tensor(v) for k, v in observation.items()}
            else:
                given = torch.as_tensor(observation)
            return np.asarray(self.module(given).cpu().numpy())


def _ask(predict: Callable[[Any, bool], Array], observation: Any) -> Array | Exception:
    """Return the actions of a policy, or the error that it raised."""
    try:
        return np.asarray(predict(observation, True))
    except Exception as error:
        return error


def _are_actions(answer: Array | Exception, shape: tuple[int, ...]) -> bool:
    """Return True for an array of finite real numbers with a shape."""
    if isinstance(answer, Exception) or answer.dtype.kind not in "iuf":
        return False
    return answer.shape == shape and bool(np.isfinite(answer).all())


def _text(answer: Array | Exception) -> str:
    if isinstance(answer, np.ndarray):
        return f"shape {answer.shape} of {answer.dtype}, such as {answer.ravel()[:2]}"
    return f"{type(answer).__name__}: {answer}"


def _row(observation: Any, k: int) -> Any:
    if isinstance(observation, Mapping):
        return {name: array[k] for name, array in observation.items()}
    return observation[k]


def _shape(observation: Any) -> tuple[int, ...]:
    if isinstance(observation, Mapping):
        observation = next(iter(observation.values()))
    shape: tuple[int, ...] = observation.shape
    return shape
