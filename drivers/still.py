"""Driver that never moves; baseline of every success rate."""

from __future__ import annotations

import numpy as np

from marl_airhockey.toolkit import Array, Driver, View


class Still(Driver):
    """Driver that never moves."""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        return np.zeros((len(view.rng), 2)), memory


make = Still
