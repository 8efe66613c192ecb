"""Driver with a new random velocity in every step."""

from __future__ import annotations

from typing import ClassVar

from marl_airhockey.toolkit import Array, Driver, View


class Random(Driver):
    """Driver with actions that are sampled uniformly from the action space."""

    erratic: ClassVar[bool] = True

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        return view.rng.uniform(-1.0, 1.0, 2), memory


make = Random
