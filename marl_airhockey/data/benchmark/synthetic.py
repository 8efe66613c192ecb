"""Synthetic human: a policy whose actions get latency, noise and inconsistency.

It is a script, not a model of a person. Its data have these three properties of
demonstrations in known amounts.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.types import Array

LATENCY = (0.05, 0.2)
"""Range of the latency of actions, s; sampled for each episode."""
SPEED = (0.7, 1.0)
"""Range of the factor of all actions; sampled for each episode."""
TREMOR = (0.05, 0.2)
"""Range of the standard deviation of slow noise; sampled for each episode."""
TREMOR_TIME = 0.25
"""Time constant of the slow noise, s."""
SCATTER = 0.2
"""Standard deviation of the noise that is proportional to the action."""
BIAS = 0.05
"""Standard deviation of a constant error; sampled for each episode."""
LAPSE_RATE, LAPSE_TIME = 0.1, 0.4
"""Rate, 1/s, and length, s, of lapses, in which the action is 0."""
LONGEST = 64
"""Largest number of actions in the memory."""
OWN = "synthetic."
"""Prefix of the names in the memory."""


class SyntheticHuman(Driver):
    """Driver that adds errors to the actions of a policy.

    Args:
        policy: Driver whose actions are changed.
    """

    def __init__(self, policy: Driver) -> None:
        self._policy = policy
        self.observe, self.control_dt = policy.observe, policy.control_dt
        self.trained_in = policy.trained_in

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        self._policy.check(observation)

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        own = {
            "latency": rng.uniform(*LATENCY),
            "speed": rng.uniform(*SPEED),
            "spread": rng.uniform(*TREMOR),
            "bias": BIAS * rng.normal(2),
            "tremor": rng.normal(2),
            "lapse": np.zeros(worlds),
            "intents": np.zeros((worlds, LONGEST, 2)),
        }
        memory = self._policy.reset(seat, rng, worlds)
        return memory | {OWN + name: value for name, value in own.items()}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        inner = {n: v for n, v in memory.items() if not n.startswith(OWN)}
        own = {n[len(OWN) :]: v for n, v in memory.items() if n.startswith(OWN)}
        intent, inner = self._policy.act(view, inner)
        dt, rng = view.control_dt, view.rng
        intents = np.concatenate([intent[:, None], own["intents"][:, :-1]], 1)
        late = np.minimum(np.round(own["latency"] / dt).astype(int), LONGEST - 1)
        action = own["speed"][:, None] * intents[np.arange(len(late)), late]
        keep = np.exp(-dt / TREMOR_TIME)
        tremor = keep * own["tremor"] + np.sqrt(1 - keep**2) * rng.normal(2)
        lapse = np.maximum(own["lapse"] - dt, 0.0)
        begins = rng.uniform(0.0, 1.0) < LAPSE_RATE * dt
        lapse = np.where(begins, LAPSE_TIME, lapse)
        action = action * (1.0 + SCATTER * rng.normal(2)) + own["bias"]
        action += own["spread"][:, None] * tremor
        action[lapse > 0.0] = 0.0
        own |= {"intents": intents, "tremor": tremor, "lapse": lapse}
        new = {OWN + name: value for name, value in own.items()}
        return np.clip(action, -1.0, 1.0), inner | new
