"""Perception: what seats sense, and see the reaction of the game later."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from marl_airhockey.types import Array

Parts = Mapping[str, Mapping[str, Any]]
"""Arrays (B, ...) by part and name, such as the fields of a state; what else is in the
mappings does not change and is left out."""


class Perception:
    """Past of what is sensed in B worlds, over some control steps.

    Before an episode there was nothing else than its beginning.

    Args:
        steps: control steps between what happens and what is seen of it.
    """

    def __init__(self, steps: int) -> None:
        self.steps = steps
        self._newest = 0
        self._past: dict[tuple[str, str], Array] = {}
        """(steps + 1, B, ...) by part and name, in a ring"""

    def begin(self, worlds: Array, parts: Parts) -> None:
        """Begin anew in some worlds, by index (W,)."""
        for key, now in _arrays(parts):
            self._ring(key, now)[:, worlds] = now[worlds]

    def push(self, parts: Parts) -> None:
        """Take what is sensed after a step."""
        self._newest = (self._newest + 1) % (self.steps + 1)
        for key, now in _arrays(parts):
            self._ring(key, now)[self._newest] = now

    def _ring(self, key: tuple[str, str], now: Array) -> Array:
        """Return the past of an array; a driver may ask for one at any time."""
        if key not in self._past:
            self._past[key] = np.repeat(now[None], self.steps + 1, axis=0)
        return self._past[key]

    def seen(self, part: str) -> dict[str, Any]:
        """Return the arrays of a part as seats see them now, not to be changed."""
        oldest = (self._newest + 1) % (self.steps + 1)
        past = self._past.items()
        return {name: ring[oldest] for (of, name), ring in past if of == part}


def _arrays(parts: Parts) -> Iterator[tuple[tuple[str, str], Array]]:
    """Yield all arrays of parts with their keys."""
    for part, named in parts.items():
        for name, array in named.items():
            if isinstance(array, np.ndarray):
                yield (part, name), array
