"""Mirrored views of players, for other-play (Hu and others, 2020)."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from marl_airhockey.types import Array

ACROSS = re.compile(r"\.(y|vy|dy|spin)$")
"""End of the labels of elements that change their sign in a mirror."""


class Mirror:
    """Mirror at the long axis of the table, for some slots in each episode.

    A mirrored slot sees the table mirrored, and its actions are mirrored, too. The
    rules of a game do not change by this. Partners therefore cannot agree on a side of
    the table, which a partner of another training would not know.

    Args:
        labels: Label of each element of an observation.
        share: Share of the episodes in which a slot is mirrored, 0 to 1.
        seed: Seed of the choice.

    Raises:
        ValueError: Observations have no labels, because they are images.
    """

    def __init__(self, labels: Sequence[str], share: float, seed: int) -> None:
        if not labels:
            raise ValueError("mirrored_share: images are not mirrored; set it to 0")
        self._across = np.array([bool(ACROSS.search(name)) for name in labels])
        self._share, self._rng = share, np.random.default_rng(seed)
        self._sign = np.ones(0, np.float32)

    def begin(self, slots: Array, count: int) -> None:
        """Choose again in some slots, by index, of ``count`` slots."""
        if len(self._sign) != count:
            self._sign = np.ones(count, np.float32)
        mirrored = self._rng.random(len(slots)) < self._share
        self._sign[slots] = np.where(mirrored, -1.0, 1.0)

    def observations(self, seen: Array) -> Array:
        """Return the observations (slots, D) as the slots see them."""
        return np.where(self._across, seen * self._sign[:, None], seen)

    def actions(self, given: Array) -> Array:
        """Return the actions (slots, 2) in ego frames for those of the slots."""
        return np.stack([given[:, 0], given[:, 1] * self._sign], -1)
