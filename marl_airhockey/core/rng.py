"""Random numbers: one stream per world, independent of the number of worlds.

A stream is a counter hashed with splitmix64 (Steele, Lea and Flood, "Fast splittable
pseudorandom number generators", 2014), so that a batch draws in one vector operation
and row i of 4096 worlds equals a single world with seed + i.
"""

from __future__ import annotations

import math
import zlib
from typing import Any

import numpy as np
from numba import njit

from marl_airhockey.types import Array

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = (np.uint64(n) for n in (30, 27, 31, 11))


@njit(cache=True)
def _mix(z: Any) -> Any:
    z = (z ^ (z >> _30)) * _MIX_1
    z = (z ^ (z >> _27)) * _MIX_2
    return z ^ (z >> _31)


@njit(cache=True)
def _begin(
    keys: Array, counts: Array, rows: Array, seeds: Array, episodes: Array, salt: int
) -> None:
    for row in rows:
        world = _mix(np.uint64(seeds[row]) * _GOLDEN + _GOLDEN)
        episode = _mix(np.uint64(episodes[row]) * _GOLDEN + np.uint64(salt))
        keys[row] = _mix(world ^ episode)
        counts[row] = 0


@njit(cache=True)
def _unit(keys: Array, counts: Array, rows: Array, out: Array) -> None:
    """Fill ``out`` (W, n) with numbers in [0, 1)."""
    for i in range(len(rows)):
        row = rows[i]
        for k in range(out.shape[1]):
            counts[row] += np.uint64(1)
            bits = _mix(keys[row] + counts[row] * _GOLDEN)
            out[i, k] = (bits >> _11) * 2.0**-53


class RandomStreams:
    """Random streams of W worlds; every method returns one row per world.

    ``select`` returns the streams of some of the rows, shared, so that a rejection loop
    advances only the worlds that draw again.
    """

    def __init__(self, keys: Array, counts: Array, rows: Array) -> None:
        self._keys, self._counts, self._rows = keys, counts, rows

    @classmethod
    def keyed(cls, seeds: Array, episodes: Array, purpose: str) -> RandomStreams:
        """Return new streams, keyed by seed of the world, episode and purpose.

        Args:
            seeds: (W,) integer seeds, one per world.
            episodes: (W,) integer episode numbers.
            purpose: use of the numbers; streams of two purposes are independent.
        """
        rows = np.arange(len(seeds))
        keys, counts = np.zeros((2, len(rows)), np.uint64)
        rng = cls(keys, counts, rows)
        rng.renew(rows, seeds, episodes, purpose)
        return rng

    def renew(self, rows: Array, seeds: Array, episodes: Array, purpose: str) -> None:
        """Restart the streams of some worlds, by index, for their next episode."""
        salt = zlib.crc32(purpose.encode())
        _begin(self._keys, self._counts, rows, seeds, episodes, salt)

    def __len__(self) -> int:
        return len(self._rows)

    def select(self, rows: Array | slice) -> RandomStreams:
        """Return the streams of ``rows`` (a mask or indices into these rows)."""
        return RandomStreams(self._keys, self._counts, self._rows[rows])

    def uniform(self, low: Array | float, high: Array | float, *shape: int) -> Array:
        """Draw (W, *shape) numbers uniform in [low, high)."""
        unit = np.empty((len(self._rows), math.prod(shape)))
        _unit(self._keys, self._counts, self._rows, unit)
        return low + (high - low) * unit.reshape(len(unit), *shape)

    def normal(self, *shape: int) -> Array:
        """Draw (W, *shape) standard normal numbers (Box and Muller's transform)."""
        pair = self.uniform(0.0, 1.0, 2, *shape)
        radius = np.sqrt(-2.0 * np.log1p(-pair[:, 0]))
        return np.asarray(radius * np.cos(2.0 * np.pi * pair[:, 1]))
