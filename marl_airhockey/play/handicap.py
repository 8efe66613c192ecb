"""Handicaps, which limit drivers to human latency, precision and speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.types import Array

BOUNDS = {"reaction": (0.0, 0.3), "noise": (0.0, 1.0), "pace": (0.05, 1.0)}
"""Smallest and largest value of each field of `Handicap`."""


@dataclass(frozen=True)
class Handicap:
    """Limits of a driver; the defaults are no limits.

    Raises:
        ValueError: A value is outside `BOUNDS`.
    """

    reaction: float = 0.0
    """Latency of each action, s; rounded to a multiple of the driver's control_dt."""
    noise: float = 0.0
    """Standard deviation of normal noise on each component of the action, as a
    fraction of the top speed."""
    pace: float = 1.0
    """Largest norm of the action, as a fraction of the top speed."""

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            value, unit = getattr(self, name), " s" if name == "reaction" else ""
            if not low <= value <= high:
                raise ValueError(
                    f"{name}: {value:g}{unit} must be in {low:g} .. {high:g}{unit}"
                )

    def apply(self, driver: Driver) -> Driver:
        """Return `driver` with these limits."""
        return HandicappedDriver(driver, self)

    @property
    def caption(self) -> str:
        """Text of the fields that differ from the defaults; "" for none."""
        usual = vars(Handicap())
        changed = {k: v for k, v in vars(self).items() if v != usual[k]}
        return ", ".join(f"{k} {v:g}" for k, v in changed.items())


PRESETS = {
    "full strength": Handicap(),
    # In addition, the games have an observation latency of 0.15 s.
    "human speed": Handicap(reaction=0.05, noise=0.05, pace=0.7),
    "gentle": Handicap(reaction=0.1, noise=0.1, pace=0.4),
}
"""Handicaps that a page offers, starting with the one without limits."""
USUAL = "human speed"
"""Default handicap of drivers that play against people."""


@dataclass
class HandicappedDriver(Driver):
    """Driver that applies a handicap to the actions of another driver.

    It has the control_dt of the other driver. If the other driver has none, it has the
    control_dt of its training, or else 0.05 s.
    """

    inner: Driver
    handicap: Handicap

    def __post_init__(self) -> None:
        self.observe = self.inner.observe
        trained = self.inner.trained_in.get("control_dt")
        self.control_dt = self.inner.control_dt or trained or 0.05
        self._delay = round(self.handicap.reaction / self.control_dt)

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        self.inner.check(observation)

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        memory = self.inner.reset(seat, rng, worlds)
        return {**memory, "delayed_actions": np.zeros((worlds, self._delay, 2))}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        waiting = memory["delayed_actions"]
        rest = {k: rows for k, rows in memory.items() if k != "delayed_actions"}
        newest, rest = self.inner.act(view, rest)
        queue = np.concatenate([waiting, newest[:, None]], axis=1)
        action = queue[:, 0]
        if self.handicap.noise:
            action = action + self.handicap.noise * view.rng.normal(2)
        norm = np.maximum(np.hypot(action[:, 0], action[:, 1]), 1e-9)
        action = action * np.minimum(self.handicap.pace / norm, 1.0)[:, None]
        return action, {**rest, "delayed_actions": queue[:, 1:]}

    def __enter__(self) -> Self:
        self.inner.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.inner.__exit__(kind, error, trace)
