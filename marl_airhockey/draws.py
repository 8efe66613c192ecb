"""Random numbers: one stream a world, the same whatever the number of worlds.

A stream is a counter hashed with splitmix64 (Steele, Lea and Flood, "Fast splittable
pseudorandom number generators", 2014), so that a batch draws in one vector operation
and row i of 4096 worlds equals a single world with seed + i.
"""

from __future__ import annotations

import zlib

import numpy as np

from marl_airhockey.state import Array

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)


def _mix(z: Array) -> Array:
    z = (z ^ (z >> np.uint64(30))) * _MIX_1
    z = (z ^ (z >> np.uint64(27))) * _MIX_2
    return np.asarray(z ^ (z >> np.uint64(31)))


def _keys(seeds: Array, episodes: Array, purpose: str) -> Array:
    salt = np.uint64(zlib.crc32(purpose.encode()))
    worlds = _mix(seeds.astype(np.uint64) * _GOLDEN + _GOLDEN)
    return _mix(worlds ^ _mix(episodes.astype(np.uint64) * _GOLDEN + salt))


class Draws:
    """Streams of W worlds; every method gives one row per world.

    ``select`` gives the same streams for some of the rows, so that a rejection loop
    advances only the worlds that draw again.
    """

    def __init__(self, keys: Array, counts: Array, rows: Array) -> None:
        self._keys, self._counts, self._rows = keys, counts, rows

    @classmethod
    def keyed(cls, seeds: Array, episodes: Array, purpose: str) -> Draws:
        """Streams keyed by (seed of the world, episode, purpose), at their beginning.

        Args:
            seeds: (W,) integer seeds, one a world.
            episodes: (W,) integer episode numbers.
            purpose: what the numbers are for; streams of two purposes are independent.
        """
        keys = _keys(seeds, episodes, purpose)
        return cls(keys, np.zeros(len(keys), np.uint64), np.arange(len(keys)))

    def renew(self, mask: Array, seeds: Array, episodes: Array, purpose: str) -> None:
        """Begin the streams of some worlds anew, for their next episode."""
        self._keys[mask] = _keys(seeds[mask], episodes[mask], purpose)
        self._counts[mask] = 0

    def __len__(self) -> int:
        return len(self._rows)

    def select(self, rows: Array | slice) -> Draws:
        """The streams of ``rows`` (a mask or indices into these rows)."""
        return Draws(self._keys, self._counts, self._rows[rows])

    def uniform(self, low: Array | float, high: Array | float, *shape: int) -> Array:
        """(W, *shape) numbers uniform in [low, high)."""
        size = int(np.prod(shape, dtype=int))
        first = self._counts[self._rows]
        self._counts[self._rows] = first + np.uint64(size)
        steps = first[:, None] + np.arange(1, size + 1, dtype=np.uint64)
        bits = _mix(self._keys[self._rows][:, None] + steps * _GOLDEN)
        unit = (bits >> np.uint64(11)) * 2.0**-53
        return low + (high - low) * unit.reshape(len(self._rows), *shape)

    def normal(self, *shape: int) -> Array:
        """(W, *shape) standard normal numbers (Box and Muller's transform)."""
        pair = self.uniform(0.0, 1.0, 2, *shape)
        radius = np.sqrt(-2.0 * np.log1p(-pair[:, 0]))
        return np.asarray(radius * np.cos(2.0 * np.pi * pair[:, 1]))
