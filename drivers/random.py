"""Random driver: a new random velocity at every step."""

from __future__ import annotations

from typing import ClassVar

from marl_airhockey.toolkit import Array, Driver, View


class Random(Driver):
    """Driver with actions uniform in the action box."""

    erratic: ClassVar[bool] = True

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        return view.rng.uniform(-1.0, 1.0, 2), memory


make = Random
