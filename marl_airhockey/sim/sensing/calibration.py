"""Calibration error: a smooth error of sensed positions, constant in an episode."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marl_airhockey.sim.core.rng import RandomStreams
from marl_airhockey.sim.jit.cache import compiled
from marl_airhockey.sim.jit.elementary import cos, sin
from marl_airhockey.types import Array

WAVES = 4
"""Number of plane waves in a map, for each component."""
LENGTHS = (0.7, 1.4)
"""Range of the wavelengths, in widths of the table. The error that was measured on a
real table had a period of about one width."""


class Waves(NamedTuple):
    """Plane waves of the maps of B worlds, for both components."""

    x: Array
    """Wave numbers along x (B, WAVES, 2), rad/m."""
    y: Array
    """Wave numbers along y (B, WAVES, 2), rad/m."""
    phase: Array
    """Phases (B, WAVES, 2), rad."""
    height: Array
    """Amplitudes (B,), m."""


class CalibrationMap:
    """Map of the calibration error in B worlds: a sum of plane waves of any direction.

    The standard deviation over positions and episodes is the ``sd`` of `sample`.

    Args:
        worlds: Number of worlds, B.
        width: Width of the table, m.
    """

    def __init__(self, worlds: int, width: float) -> None:
        self._width = width
        shape = (3, worlds, WAVES, 2)
        x, y, phase = np.zeros(shape)
        self.waves = Waves(x, y, phase, np.zeros(worlds))

    def sample(self, rng: RandomStreams, sd: Array, worlds: Array) -> None:
        """Sample new maps for some worlds.

        Args:
            rng: Random streams of these worlds.
            sd: Standard deviations (W,), m.
            worlds: Indices (W,) of the worlds.
        """
        unit, waves = rng.units(3, WAVES, 2), self.waves
        low, high = (2.0 * np.pi / (self._width * length) for length in LENGTHS[::-1])
        number = low + (high - low) * unit[:, 0]
        heading = 2.0 * np.pi * unit[:, 1]
        waves.phase[worlds] = 2.0 * np.pi * unit[:, 2]
        waves.x[worlds] = number * cos(heading)
        waves.y[worlds] = number * sin(heading)
        waves.height[worlds] = sd * np.sqrt(2.0 / WAVES)

    def shifted(self, position: Array, worlds: Array) -> Array:
        """Add the error to positions (W, n, 2) in some worlds, by index (W,), m."""
        out = np.empty(position.shape)
        _shift(self.waves, worlds, position, out)
        return out


@compiled(nogil=True, error_model="numpy")
def _shift(waves: Waves, worlds: Array, position: Array, out: Array) -> None:
    for row in range(len(worlds)):
        for k in range(position.shape[1]):
            x, y = position[row, k]
            out[row, k] = shift(waves, worlds[row], x, y)


@compiled(nogil=True, error_model="numpy")
def shift(waves: Waves, w: int, x: float, y: float) -> tuple[float, float]:
    """Add the error to a position in world ``w``, m."""
    dx = dy = 0.0
    for k in range(WAVES):
        phase = waves.phase[w, k]
        dx += cos(waves.x[w, k, 0] * x + waves.y[w, k, 0] * y + phase[0])
        dy += cos(waves.x[w, k, 1] * x + waves.y[w, k, 1] * y + phase[1])
    return x + waves.height[w] * dx, y + waves.height[w] * dy
