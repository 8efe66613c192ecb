"""A fair opponent: a driver made as slow, as late and as unsteady as a person."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np

from marl_airhockey.contracts.driver import Driver, View
from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.core.seat import Seat
from marl_airhockey.types import Array


@dataclass
class Handicap(Driver):
    """Passes on what another driver asks: later, with noise, at a lower pace.

    Raises:
        ValueError: a value out of its range, named.
    """

    inner: Driver
    reaction: float = 0.0
    """s by which it acts late, 0 to 0.3; rounded to its own decisions."""
    noise: float = 0.0
    """Deviation of normal noise on what it asks, as a fraction of top speed."""
    pace: float = 1.0
    """Largest fraction of top speed that it asks for."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("reaction", 0.0, 0.3),
            ("noise", 0.0, 1.0),
            ("pace", 0.05, 1.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name}: {value} must be in {low} .. {high}")
        self.observe = self.inner.observe
        # Policies were trained to decide every 50 ms, whatever the loop's rate is.
        self.control_dt = self.inner.control_dt or 0.05
        self._late = round(self.reaction / self.control_dt)

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        memory = self.inner.reset(seat, rng, worlds)
        return {**memory, "waiting": np.zeros((worlds, self._late, 2))}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        waiting = memory["waiting"]
        rest = {name: rows for name, rows in memory.items() if name != "waiting"}
        action, rest = self.inner.act(view, rest)
        queue = np.concatenate([waiting, action[:, None]], axis=1)
        late = queue[:, 0]
        if self.noise:
            late = late + self.noise * view.rng.normal(2)
        size = np.maximum(np.hypot(late[:, 0], late[:, 1]), 1e-9)
        late = late * np.minimum(self.pace / size, 1.0)[:, None]
        return late, {**rest, "waiting": queue[:, 1:]}

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


@dataclass(frozen=True)
class Fairness:
    """How programs are held back; see `handicap.Handicap`."""

    reaction: float = 0.0
    noise: float = 0.0
    pace: float = 1.0

    def hold(self, driver: Driver) -> Driver:
        """The driver, held back."""
        return Handicap(driver, self.reaction, self.noise, self.pace)

    @property
    def words(self) -> str:
        """What is held back, in words; nothing for none of it."""
        usual = vars(Fairness())
        held = {k: v for k, v in vars(self).items() if v != usual[k]}
        return ", ".join(f"{k} {v:g}" for k, v in held.items())


STRENGTHS = {
    "full strength": Fairness(),
    "human speed": Fairness(reaction=0.15, noise=0.05, pace=0.7),
    "gentle": Fairness(reaction=0.25, noise=0.1, pace=0.4),
}
"""How programs are held back at a page's choice, the full-strength one first."""
