"""Random numbers: one stream per world, independent of the number of worlds.

A stream is a counter that is hashed with splitmix64 (Steele, Lea and Flood, "Fast
splittable pseudorandom number generators", 2014). A batch is therefore sampled in one
vector operation, and row i of 4096 worlds equals a single world with seed + i.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from marl_airhockey.sim.jit.cache import compiled, inner
from marl_airhockey.sim.jit.elementary import cos, log1p, sin
from marl_airhockey.sim.jit.pipeline import Fixed, Stage
from marl_airhockey.types import Array

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = (np.uint64(n) for n in (30, 27, 31, 11))


@inner()
def mix(z: Any) -> Any:
    """Return the hash of a 64-bit number."""
    z = (z ^ (z >> _30)) * _MIX_1
    z = (z ^ (z >> _27)) * _MIX_2
    return z ^ (z >> _31)


@compiled()
def _begin(
    keys: Array, counts: Array, rows: Array, seeds: Array, episodes: Array, salts: Array
) -> None:
    for row in rows:
        world = mix(np.uint64(seeds[row]) * GOLDEN + GOLDEN)
        for k in range(len(salts)):
            episode = mix(np.uint64(episodes[row]) * GOLDEN + salts[k])
            keys[k, row] = mix(world ^ episode)
            counts[k, row] = 0


@compiled()
def _unit(keys: Array, counts: Array, rows: Array, out: Array) -> None:
    """Fill ``out`` (W, n) with numbers in [0, 1)."""
    for i in range(len(rows)):
        key, count, n = keys[rows[i]], counts[rows[i]], out.shape[1]
        for k in range(n):
            bits = mix(key + (count + np.uint64(k + 1)) * GOLDEN)
            out[i, k] = (bits >> _11) * 2.0**-53
        counts[rows[i]] = count + np.uint64(n)


@inner(error_model="numpy")
def normal_pair(first: float, second: float) -> tuple[float, float]:
    """Return two standard normal numbers, given two uniform ones (Box and Muller)."""
    radius, phase = math.sqrt(-2.0 * log1p(-first)), 2.0 * math.pi * second
    return radius * cos(phase), radius * sin(phase)


def _is_seed(value: Any) -> bool:
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    return whole and 0 <= value < 2**64


def seeds_of(seed: int | Sequence[int], worlds: int) -> Array:
    """Return the seeds of all worlds (worlds,), uint64.

    Args:
        seed: Seed of world 0, or a sequence with a seed for each world. World i gets
            seed + i (modulo 2^64), or element i of the sequence.
        worlds: Number of worlds.

    Raises:
        ValueError: The seed is neither a whole number from 0 to 2^64 - 1 nor a sequence
            with one for each world.
    """
    # Objects, because a list of large and small numbers would become floats.
    given = np.array(seed, object)
    whole = all(_is_seed(x) for x in given.flat)
    if not whole or given.shape not in ((), (worlds,)):
        raise ValueError(
            f"seed: {seed!r}; expected a whole number from 0 to 2^64 - 1, or one for "
            f"each of {worlds} worlds"
        )
    if given.ndim:
        return given.astype(np.uint64)
    return np.uint64(int(given)) + np.arange(worlds, dtype=np.uint64)


class RandomStreams:
    """Random streams of W worlds. Every method returns one row per world.

    ``select`` returns the streams of some rows. They share their state with these
    streams, so a rejection loop advances only the worlds that sample again.
    """

    spread: float = 1.0
    """Share of every range, around its middle, from which `uniform` samples."""

    def __init__(
        self, keys: Array, counts: Array, rows: Array, ordinals: Array
    ) -> None:
        self._keys, self._counts, self._rows = keys, counts, rows
        self._ordinals = ordinals

    @classmethod
    def keyed(cls, seeds: Array, episodes: Array, purpose: str) -> RandomStreams:
        """Return new streams for one purpose, as of a `StreamSet`.

        Args:
            seeds: Seeds (W,) of the worlds, integers.
            episodes: Numbers (W,) of the episodes, integers.
            purpose: Purpose of the random numbers.
        """
        streams = StreamSet(len(seeds), purpose)
        streams.renew(np.arange(len(seeds)), seeds, episodes)
        return streams.of(purpose)

    def __len__(self) -> int:
        return len(self._rows)

    def select(self, rows: Array | slice) -> RandomStreams:
        """Return the streams of ``rows`` (a mask or indices into these rows)."""
        some = RandomStreams(self._keys, self._counts, self._rows[rows], self._ordinals)
        some.spread = self.spread
        return some

    @property
    def ordinals(self) -> Array:
        """Seed of the world plus number of the episode, from 0, modulo 2^64 (W,).

        Scenarios that begin with listed situations in turn use it as the index.
        """
        return self._ordinals[self._rows]

    def units(self, *shape: int) -> Array:
        """Sample (W, *shape) numbers uniform in [0, 1)."""
        unit = np.empty((len(self._rows), math.prod(shape)))
        _unit(self._keys, self._counts, self._rows, unit)
        return unit.reshape(len(unit), *shape)

    def stage(self, unit: Array) -> Stage:
        """Return a stage that fills an array (W, n) with numbers uniform in [0, 1)."""
        arrays = self._keys, self._counts, Fixed(self._rows), unit
        return Stage(_unit, arrays)

    def uniform(self, low: Array | float, high: Array | float, *shape: int) -> Array:
        """Sample (W, *shape) numbers uniform in [low, high), narrowed by `spread`."""
        drawn = self.units(*shape)
        if self.spread != 1.0:
            drawn = 0.5 + self.spread * (drawn - 0.5)
        drawn *= high - low
        drawn += low
        return drawn

    def normal(self, *shape: int) -> Array:
        """Sample (W, *shape) standard normal numbers (Box and Muller's transform)."""
        pair = self.units(2, *shape)
        radius = np.sqrt(-2.0 * log1p(-pair[:, 0]))
        return np.asarray(radius * cos(2.0 * np.pi * pair[:, 1]))


class StreamSet:
    """Independent random streams of W worlds for several purposes.

    They are keyed by the seed of the world, the number of its episode and the purpose.

    Args:
        worlds: Number of worlds, W.
        purposes: Names of the purposes.
    """

    def __init__(self, worlds: int, *purposes: str) -> None:
        self._place = {purpose: k for k, purpose in enumerate(purposes)}
        salts = [zlib.crc32(purpose.encode()) for purpose in purposes]
        self._salts = np.array(salts, np.uint64)
        self._keys, self._counts = np.zeros((2, len(salts), worlds), np.uint64)
        self._ordinals = np.zeros(worlds, np.uint64)
        self._all = np.arange(worlds)

    def renew(self, rows: Array, seeds: Array, episodes: Array) -> None:
        """Restart the streams of some worlds for their next episode.

        Args:
            rows: Indices (w,) of the worlds.
            seeds: Seeds (W,) of all worlds, integers.
            episodes: Numbers (W,) of the episodes of all worlds, integers.
        """
        # One type, so that one compiled function serves all callers.
        seeds = seeds.astype(np.uint64, copy=False)
        self._ordinals[rows] = seeds[rows] + episodes[rows].astype(np.uint64) - 1
        _begin(self._keys, self._counts, rows, seeds, episodes, self._salts)

    def keys(self, purpose: str) -> Array:
        """Return a view of the keys (W,), uint64, of the streams for a purpose."""
        return np.asarray(self._keys[self._place[purpose]])

    def of(self, purpose: str, rows: Array | None = None) -> RandomStreams:
        """Return the streams for a purpose; they share their state with this set.

        Args:
            purpose: Name of the purpose.
            rows: Indices of the worlds; None for all.
        """
        k = self._place[purpose]
        rows = self._all if rows is None else rows
        return RandomStreams(self._keys[k], self._counts[k], rows, self._ordinals)
