"""Reaction time: latency of sensed states in whole control steps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.types import Array

Parts = Mapping[str, Mapping[str, Any]]
"""Arrays (B, ...) by part and name, such as the fields of a state. Values that are not
arrays are constant and are not delayed."""


class ReactionDelay:
    """Delay of sensed states in B worlds, by whole control steps.

    The past of a new episode is filled with its first values, or with the movement of
    bodies before it.

    Args:
        steps: Delay in control steps.
        moving: Length of a control step, s, if bodies moved at constant velocity before
            an episode; 0 if they were at rest.
    """

    def __init__(self, steps: int, moving: float = 0.0) -> None:
        self.steps, self._moving = steps, moving
        self._newest = 0
        self._past: dict[tuple[str, str], Array] = {}
        """Ring buffers (steps + 1, B, ...) by part and name."""

    @staticmethod
    def of(scenario: Scenario, steps: int, control_dt: float) -> ReactionDelay | None:
        """Return the delay of a scenario; None if seats observe the present."""
        moving = control_dt if scenario.moving_start else 0.0
        return ReactionDelay(steps, moving) if steps or scenario.hides else None

    def begin(self, worlds: Array, parts: Parts) -> None:
        """Begin an episode in some worlds, by index (W,)."""
        for key, now in _arrays(parts):
            self._ring(key, now)[:, worlds] = now[worlds]
        for back in range(1, self.steps + 1) if self._moving else ():
            for part in {"state", "estimate"} & parts.keys():
                moved = back * self._moving * parts[part]["velocity"][worlds]
                self._past[part, "position"][self._newest - back, worlds] -= moved

    def push(self, parts: Parts) -> None:
        """Append the sensed values after a step."""
        self._newest = (self._newest + 1) % (self.steps + 1)
        for key, now in _arrays(parts):
            self._ring(key, now)[self._newest] = now

    def _ring(self, key: tuple[str, str], now: Array) -> Array:
        """Return the past of an array; the first call creates it."""
        if key not in self._past:
            self._past[key] = np.repeat(now[None], self.steps + 1, axis=0)
        return self._past[key]

    def delayed(self, part: str) -> dict[str, Any]:
        """Return the arrays of a part that seats observe now; do not change them."""
        oldest = (self._newest + 1) % (self.steps + 1)
        past = self._past.items()
        return {name: ring[oldest] for (of, name), ring in past if of == part}


def whole_steps(reaction: float, control_dt: float) -> int:
    """Return a reaction time in control steps.

    Raises:
        ValueError: It is not a multiple of ``control_dt``.
    """
    steps = round(reaction / control_dt)
    if abs(steps * control_dt - reaction) > 1e-6:
        near = [k * control_dt for k in (steps, steps + 1)]
        raise ValueError(
            f"reaction: {reaction:g} s is not a multiple of control_dt, "
            f"{control_dt:g} s; set another control_dt or an option, e.g. "
            f'options={{"reaction": {near[0]:g}}} or {near[1]:g}'
        )
    return steps


def _arrays(parts: Parts) -> Iterator[tuple[tuple[str, str], Array]]:
    """Yield all arrays of parts with their keys."""
    for part, named in parts.items():
        for name, array in named.items():
            if isinstance(array, np.ndarray):
                yield (part, name), array
