"""Calibration error: a smooth error of the sensed positions, fixed in an episode."""

from __future__ import annotations

import numpy as np

from marl_airhockey.core.rng import RandomStreams
from marl_airhockey.types import Array, Rows

WAVES = 4
"""Number of plane waves in a map, for each component."""
LENGTHS = (0.7, 1.4)
"""Range of the wavelengths, in widths of the table; a map that was measured on a real
table had a period of about one width."""


class CalibrationMap:
    """Map of the calibration error in B worlds: a sum of plane waves of any direction.

    The standard deviation over positions and episodes is the ``sd`` of `sample`.

    Args:
        worlds: Number of worlds, B.
        width: Width of the table, m.
    """

    def __init__(self, worlds: int, width: float) -> None:
        self._width = width
        shape = (worlds, WAVES, 2)
        self._x, self._y = np.zeros(shape), np.zeros(shape)
        """Wave numbers along x and y of the waves of both components, rad/m"""
        self._phase, self._height = np.zeros(shape), np.zeros(worlds)

    def sample(self, rng: RandomStreams, sd: Array, worlds: Array) -> None:
        """Sample new maps for some worlds, by index (W,).

        Args:
            rng: Streams of these worlds.
            sd: Standard deviations (W,), m.
            worlds: Indices of the worlds.
        """
        unit = rng.uniform(0.0, 1.0, 3, WAVES, 2)
        low, high = (2.0 * np.pi / (self._width * length) for length in LENGTHS[::-1])
        number = low + (high - low) * unit[:, 0]
        heading, self._phase[worlds] = (
            2.0 * np.pi * unit[:, 1],
            2.0 * np.pi * unit[:, 2],
        )
        self._x[worlds], self._y[worlds] = (
            number * np.cos(heading),
            number * np.sin(heading),
        )
        self._height[worlds] = sd * np.sqrt(2.0 / WAVES)

    def shifted(self, position: Array, rows: Rows) -> Array:
        """Return positions (W, n, 2) in some worlds with the error added, m."""
        x, y = position[:, :, None, None, 0], position[:, :, None, None, 1]
        waves = self._x[rows][:, None] * x + self._y[rows][:, None] * y
        shift = np.cos(waves + self._phase[rows][:, None]).sum(2)
        return np.asarray(position + self._height[rows][:, None, None] * shift)
