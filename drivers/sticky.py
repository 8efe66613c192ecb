"""Driver with random velocities that it holds for several steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from marl_airhockey.toolkit import Array, Driver, RandomStreams, Seat, View


@dataclass
class Sticky(Driver):
    """Driver that samples a uniform action every ``hold`` steps, to cover distance."""

    erratic: ClassVar[bool] = True

    hold: int = 10
    """Number of steps for which an action is held."""

    def reset(self, seat: Seat, rng: RandomStreams, worlds: int) -> dict[str, Array]:
        return {"held": np.zeros((worlds, 2)), "age": np.zeros(worlds, np.int64)}

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        fresh = view.rng.uniform(-1.0, 1.0, 2)
        again = (memory["age"] % self.hold == 0)[:, None]
        held = np.where(again, fresh, memory["held"])
        return held, {"held": held, "age": memory["age"] + 1}


make = Sticky
