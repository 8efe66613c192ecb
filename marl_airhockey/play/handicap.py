"""Handicaps, which limit drivers to human latency, precision and speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import exp
from types import TracebackType
from typing import Self

import numpy as np

from marl_airhockey.sim.contracts.driver import Driver, View
from marl_airhockey.sim.contracts.image_form import shows_images
from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.core.seat import Seat
from marl_airhockey.sim.core.state import State
from marl_airhockey.types import Array

BOUNDS = {"reaction": (0.0, 0.5), "noise": (0.0, 0.2), "pace": (0.05, 1.0)}
"""Smallest and largest value of each field of `Handicap`."""
UNITS = {"reaction": " s", "noise": " m", "pace": ""}
CORRELATION = 0.25
"""Correlation time of the error of an observed puck, s: longer than a jitter."""
OWN_PACE = 0.05
"""Time between two decisions of a driver without a `control_dt`, s."""


SEEN = "handicap.seen"
"""Name of the memory with the observed pucks: positions and velocities (W, pucks, 4),
ego frame, m and m/s."""


@dataclass(frozen=True)
class Handicap:
    """Limits of a driver; the defaults are no limits.

    Raises:
        ValueError: A value is outside `BOUNDS`.
    """

    reaction: float = 0.0
    """Additional latency with which pucks and other paddles are observed, s; rounded to
    a multiple of the driver's control_dt."""
    noise: float = 0.0
    """Standard deviation of the error of each coordinate of an observed puck, m."""
    pace: float = 1.0
    """Largest norm of the action, as a fraction of the top speed."""

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            value, unit = getattr(self, name), UNITS[name]
            if not low <= value <= high:
                raise ValueError(
                    f"{name}: {value:g}{unit} must be in {low:g} .. {high:g}{unit}"
                )

    @property
    def observes(self) -> bool:
        """True if the observation of the driver is limited."""
        return self.reaction > 0.0 or self.noise > 0.0

    @property
    def caption(self) -> str:
        """Text of the fields that differ from the defaults; "" for none."""
        usual = vars(Handicap())
        changed = {k: v for k, v in vars(self).items() if v != usual[k]}
        return ", ".join(f"{k} {v:g}" for k, v in changed.items())


@dataclass
class HandicappedDriver(Driver):
    """Driver that observes with latency and errors, and moves slowly.

    Its own paddle is observed without additional latency. It has the control_dt of the
    other driver. If the other driver has none, it has the control_dt of its training,
    or else `OWN_PACE`.

    Args:
        inner: Other driver.
        handicap: Limits of observations and speed.

    Raises:
        ValueError: The other driver observes histories or images, and the handicap
            limits observations.
    """

    inner: Driver
    handicap: Handicap

    def __post_init__(self) -> None:
        self.observe = self.inner.observe
        trained = self.inner.trained_in.get("control_dt")
        self.control_dt = self.inner.control_dt or trained or OWN_PACE
        past = self.observe == "history" or shows_images(self.observe)
        if self.handicap.observes and past:
            raise ValueError(
                f"reaction and noise must be 0 for a driver with observe={self.observe}"
            )
        self._delay = round(self.handicap.reaction / self.control_dt)

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        self.inner.check(observation)

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        return {
            **self.inner.reset(seat, rng, worlds),
            "handicap.begun": np.zeros(worlds, np.bool_),
        }

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        own = {k: rows for k, rows in memory.items() if k.startswith("handicap.")}
        rest = {k: rows for k, rows in memory.items() if k not in own}
        if self.handicap.observes:
            seen, own = self.perceive(view, own)
            read = view.read
            view = replace(view, state=seen, read=lambda _: read(seen))
        pucks = view.state.puck, view.state.puck_velocity
        own[SEEN] = np.concatenate(pucks, axis=-1)
        action, rest = self.inner.act(view, rest)
        norm = np.maximum(np.hypot(action[:, 0], action[:, 1]), 1e-9)
        action = action * np.minimum(self.handicap.pace / norm, 1.0)[:, None]
        return action, {**rest, **own}

    def perceive(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[State, dict[str, Array]]:
        """Return the state that the driver observes (W, ...), and the new memory."""
        state, first = view.state, ~memory["handicap.begun"]
        now = np.concatenate([state.position, state.velocity], axis=-1)
        pucks = state.bodies.puck
        past = memory.get("handicap.past")
        if past is None:
            past = np.repeat(now[:, None], self._delay, axis=1)
            error = np.zeros((*first.shape, state.bodies.pucks, 2))
        else:
            error = memory["handicap.error"]
        past = np.where(first[:, None, None, None], now[:, None], past)
        past = np.concatenate([past, now[:, None]], axis=1)
        late = past[:, 0].copy()
        late[:, view.seat] = now[:, view.seat]
        kept = np.where(first, 0.0, exp(-view.control_dt / CORRELATION))[:, None, None]
        fresh = self.handicap.noise * view.rng.normal(state.bodies.pucks, 2)
        error = kept * error + np.sqrt(1.0 - kept**2) * fresh
        late[:, pucks, :2] += error
        seen = replace(state, position=late[..., :2], velocity=late[..., 2:])
        return seen, {
            "handicap.begun": np.ones_like(first),
            "handicap.past": past[:, 1:],
            "handicap.error": error,
        }

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
