"""Orders in which the participants of a study play the opponents."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def _balanced(count: int, seed: int, number: int) -> list[int]:
    """Return a row of a Latin square that is balanced for carry-over effects.

    In all rows together, each opponent follows each other opponent equally often
    (Williams, 1949). For an even number of opponents this needs one square. For an odd
    number the mirror image of the square is the second half. The seed determines which
    opponent is which letter.
    """
    first = [0]
    for k in range(1, count):
        first.append((first[-1] + (k if k % 2 else -k)) % count)
    rows = count if count % 2 == 0 else 2 * count
    row = number % rows
    letters = [(letter + row) % count for letter in first]
    if row >= count:
        letters.reverse()
    names = np.random.default_rng(seed).permutation(count)
    return [int(names[letter]) for letter in letters]


def _random(count: int, seed: int, number: int) -> list[int]:
    """Return a random permutation for each participant."""
    drawn: list[int] = np.random.default_rng([seed, number]).permutation(count).tolist()
    return drawn


def _fixed(count: int, seed: int, number: int) -> list[int]:
    """Return the order of the plan for all participants."""
    return list(range(count))


ORDERS: dict[str, Callable[[int, int, int], list[int]]] = {
    "balanced": _balanced,
    "random": _random,
    "fixed": _fixed,
}
"""Functions (opponents, seed, participant) -> indices of opponents, by name."""
